"""Reconfiguration: time to the first torque after a change of structure of an arm of hinges.

Each change is made, and the torques at one state are computed: by `dyn.Rows`, changed in place; by a rebuild, the graph
of inverse dynamics derived, compiled and called; by Pinocchio, whose model is copied and appended to, or reduced, and
rnea; and by MuJoCo, the same edit of its MjSpec, compiled, and `mj_inverse`. Every change has bodies and numbers of its
own, made before the clock starts. Raises ArithmeticError where torques do not agree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.experiments.timing import spent
from dynamics.io.mujoco_module import mujoco
from dynamics.io.write_mjcf import to_mjcf
from dynamics.multibody.algebra.spatial import rotation, to_quaternion
from dynamics.multibody.bodies.body import Body, Joint
from dynamics.multibody.trees.mechanism import Mechanism
from dynamics.verification.pinocchio_model import PinocchioModel, pinocchio
from dynamics.verification.residual import UnavailableError
from tests.bench.peers.peer import made
from tests.bench.tables import Table
from tests.bench.timing import relative_difference
from viz.paper.mechanisms import turned_arm

Work = Callable[[], Any]  # gives torques
LINKS, REPEATS = 30, 100
REBUILDS = 2  # of each change, and MuJoCo's: they take long
AGREE = 1e-8  # relative differences that pass: MuJoCo's text has digits
LOCKED = 0.3  # rad
MASS, CENTER, INERTIA, OFFSET = 1.0, (0.0, 0.05, 0.0), (2e-3, 3e-3, 4e-3), (0.1, 0.0, -0.2)


def module(name: str, parent: str, kind: str = "revolute") -> Body:
    """A body for the tip."""
    return Body(name, Joint(kind, (0.0, 0.0, 1.0), OFFSET), parent, MASS, CENTER, INERTIA)


def _limb(arm: Mechanism) -> list[Body]:
    names = [arm.bodies[-1].name, *[f"limb {k}" for k in range(4)]]
    return [module(name, parent) for parent, name in pairwise(names)]


CHANGES = {
    "attach a tool": (lambda arm: [module("tool", arm.bodies[-1].name, "fixed")], "attach", 0),
    "attach a joint": (lambda arm: [module("tool", arm.bodies[-1].name)], "attach", 1),
    "attach a limb of 4": (_limb, "attach", 4),
    "detach": (lambda arm: arm.bodies[-1].name, "detach", -1),
    "lock": (lambda arm: arm.bodies[len(arm.bodies) // 2].name, "lock", -1),
}


def at(n: int) -> tuple[Array, Array, Array]:
    """A state."""
    q = np.linspace(-0.5, 0.5, n)
    return q, q / 2, -q


def _change(of: Any, method: str, what: Any) -> Any:
    return of.lock(what, LOCKED) if method == "lock" else getattr(of, method)(what)


def by_rows(arm: Mechanism, what: Any, method: str, n: int) -> Work:
    """Rows that are there, changed in place."""
    rows, state = dyn.Rows(arm), at(n)
    rows.inverse(*at(rows.n))

    def work() -> Array:
        _change(rows, method, what)
        return rows.inverse(*state)

    return work


def by_rebuild(arm: Mechanism, what: Any, method: str, n: int) -> Work:
    """A graph of its own."""
    return lambda: cg.compile(inverse_dynamics(_change(replace(arm), method, what)))(np.concatenate(at(n)))


def by_pinocchio(arm: Mechanism, what: Any, method: str, n: int) -> Work:
    """A copy of its model with joints and bodies appended, or its reduced model. Raises ImportError without it."""
    if method == "detach":
        raise UnavailableError("has nothing that takes a body off; its reduced model is that of `lock`")
    pin, model = pinocchio(), PinocchioModel(arm).model
    for joint in range(1, model.njoints):  # which the reduced model asks for
        model.addJointFrame(joint)
    inertia, place = pin.Inertia(MASS, np.array(CENTER), np.diag(INERTIA)), pin.SE3(np.eye(3), np.array(OFFSET))
    neutral, (q, qd, qdd) = np.full(model.nq, LOCKED), at(n)

    def work() -> Array:
        if method == "attach":
            changed, parent = model.copy(), model.njoints - 1
            for body in what:
                if body.joint.moves:
                    parent = changed.addJoint(parent, pin.JointModelRZ(), place, f"joint {parent}")
                changed.appendBodyToJoint(parent, inertia, pin.SE3.Identity() if body.joint.moves else place)
        else:
            changed = pin.buildReducedModel(model, [model.getJointId(what)], neutral)
        return np.array(pin.rnea(changed, changed.createData(), q, qd, qdd))

    return work


def by_mujoco(arm: Mechanism, what: Any, method: str, n: int) -> Work:
    """An edit of its MjSpec. Raises ImportError without MuJoCo."""
    module, (q, qd, qdd) = mujoco(), at(n)
    spec = module.MjSpec.from_string(to_mjcf(arm))
    spec.compile()

    def work() -> Array:
        if method == "attach":
            for body in what:
                theirs = spec.body(body.parent).add_body(name=body.name, pos=OFFSET)
                theirs.explicitinertial, theirs.mass, theirs.ipos, theirs.inertia = True, MASS, CENTER, INERTIA
                if body.joint.moves:
                    theirs.add_joint(type=module.mjtJoint.mjJNT_HINGE, axis=(0.0, 0.0, 1.0))
        elif method == "detach":
            spec.delete(spec.body(what))
        else:
            body, joint = spec.body(what), next(each.joint for each in arm.bodies if each.name == what)
            body.quat = to_quaternion(np.asarray(joint.orientation) @ rotation(np.asarray(joint.axis), LOCKED))
            spec.delete(body.joints[0])
        model = spec.compile()
        data = module.MjData(model)
        data.qpos, data.qvel, data.qacc = q, qd, qdd
        module.mj_inverse(model, data)
        return np.array(data.qfrc_inverse)

    return work


WAYS = {"rows": by_rows, "Pinocchio": by_pinocchio, "MuJoCo": by_mujoco, "rebuild": by_rebuild}


def reconfiguration(links: int = LINKS, repeats: int = REPEATS) -> Iterator[Table | str]:
    """The table: the shortest times to the first torque, in milliseconds, and the ratio of rows to others."""
    arm = turned_arm(links)
    arm = replace(arm, bodies=[replace(body, joint=replace(body.joint, damping=0.0)) for body in arm.bodies])
    absent: dict[str, str] = {}
    header = ["change", "rows", *[cell for name in list(WAYS)[1:] for cell in (name, "ratio")]]
    rows = [_row(arm, kind, repeats, absent) for kind in CHANGES]
    yield Table(f"arm of {links} hinges; milliseconds to the first torque, the shortest", header, rows)
    yield from [f"{name} is not measured: {missing}" for name, missing in absent.items()]


def _row(arm: Mechanism, kind: str, repeats: int, absent: dict[str, str]) -> list[str]:
    what, method, more = CHANGES[kind]
    n, least, expected = len(arm.coordinates) + more, dict.fromkeys(WAYS, np.inf), np.empty(0)
    for turn in range(repeats):
        names = list(WAYS) if turn < REBUILDS else ["rows", "Pinocchio"]
        ways = {name: partial(WAYS[name], arm, what(arm), method, n) for name in names}
        for name, work in made(ways, absent).items():
            taken = spent(work)
            least[name] = min(least[name], 1e3 * taken.seconds)
            expected = taken.made if name == "rows" else expected
            if not (off := relative_difference(taken.made, expected)) <= AGREE:
                raise ArithmeticError(f"{kind}, {name}: torques differ by {off:.1e} of the largest")
    return [kind, f"{least['rows']:.3f}", *[cell for name in list(WAYS)[1:] for cell in _cells(least, name)]]


def _cells(least: dict[str, float], name: str) -> list[str]:
    known = np.isfinite(least[name])
    return [f"{least[name]:.3f}", f"{least['rows'] / least[name]:.2g}"] if known else ["-", "-"]
