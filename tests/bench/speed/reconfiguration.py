"""Reconfiguration: time to the first torque after a change of structure of an arm of hinges.

Each change is applied to the arm, and the torques at one state are computed: by the kernels of
`RecursiveInverseDynamics`; by a full rebuild, the graph of inverse dynamics, compiled, and called; and by MuJoCo, the
same edit of its MjSpec, compiled, and `mj_inverse`. Every change has numbers of its own, so that nothing from an
earlier one is used again, but what an earlier run of a rebuild left in the cache of compiled code. Raises
ArithmeticError where torques do not agree, and where detaching and attaching again gives another graph.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.experiments.timing import spent
from dynamics.io.mujoco_module import mujoco
from dynamics.io.write_mjcf import to_mjcf
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.bodies.body import Body, Joint
from dynamics.multibody.quantities.recursive_inverse_dynamics import RecursiveInverseDynamics
from dynamics.multibody.trees.mechanism import Mechanism
from tests.bench.peers.peer import made
from tests.bench.tables import Table
from tests.bench.timing import relative_difference
from viz.paper.mechanisms import turned_arm

Torque = Callable[[Array], Array]  # of q, where qd = q / 2 and qdd = -q

LINKS, REPEATS = 30, 30
REBUILDS = 3  # of each change: they take long
AGREE, AGREE_MUJOCO = 1e-10, 1e-8  # relative differences that pass: rounding along the arm; MuJoCo's text has digits
MIDDLE = 0.5  # of the arm: which joint is locked


def tool(version: int) -> Body:
    """Tool for the tip."""
    grip = Joint("fixed", position=(0.1, 0.0, -0.2))
    return Body("tool", grip, mass=1.0 + 1e-3 * version, center=(0.0, 0.05, 0.0), inertia=(2e-3, 3e-3, 4e-3))


def angle(version: int) -> float:
    """Angle at which the joint in the middle is locked [rad]."""
    return 0.2 + 1e-3 * version


def by_kernels(mechanism: Mechanism) -> Torque:
    """Equations by kernels, which are there already."""
    run = RecursiveInverseDynamics(mechanism)
    return lambda q: run(q, q / 2, -q)


def by_rebuild(mechanism: Mechanism) -> Torque:
    """Equations by a mechanism that shares nothing with another."""
    fresh = Mechanism(mechanism.bodies, mechanism.gravity, locked=mechanism.locked)
    function = cg.compile(inverse_dynamics(fresh))
    return lambda q: np.asarray(function(np.concatenate([q, q / 2, -q])))


class ByMujoco:
    """The arm as an MjSpec, with the same changes. Raises ImportError without MuJoCo."""

    def __init__(self, mechanism: Mechanism, version: int) -> None:
        self.mujoco, self.version = mujoco(), version
        self.spec = self.mujoco.MjSpec.from_string(to_mjcf(mechanism))
        self.spec.compile()
        self.last = mechanism.bodies[-1].name
        self.middle = mechanism.bodies[int(MIDDLE * len(mechanism.bodies))]

    def detach(self) -> None:
        """The last body goes."""
        self.spec.delete(self.spec.body(self.last))

    def attach(self) -> None:
        """A tool on the last body."""
        body = tool(self.version)
        theirs = self.spec.body(self.last).add_body(name="tool", pos=body.joint.position)
        theirs.explicitinertial, theirs.mass, theirs.ipos, theirs.inertia = True, body.mass, body.center, body.inertia

    def lock(self) -> None:
        """The joint goes, and its body is turned to where it stands."""
        body, axis = self.spec.body(self.middle.name), np.asarray(self.middle.joint.axis)
        turned = np.asarray(self.middle.joint.orientation) @ rotation(axis, angle(self.version))
        body.alt.xyaxes = turned[:, :2].T.ravel()
        self.spec.delete(body.joints[0])

    def unlock(self) -> None:
        """The joint is there again."""
        body = self.spec.body(self.middle.name)
        body.alt.xyaxes = np.asarray(self.middle.joint.orientation)[:, :2].T.ravel()
        body.add_joint(type=self.mujoco.mjtJoint.mjJNT_HINGE, axis=self.middle.joint.axis, damping=0.1)

    def torque(self, q: Array) -> Array:
        """Compile, and inverse dynamics."""
        model = self.spec.compile()
        data = self.mujoco.MjData(model)
        data.qpos, data.qvel, data.qacc = q, q / 2, -q
        self.mujoco.mj_inverse(model, data)
        return np.array(data.qfrc_inverse)


def changes(base: Mechanism, version: int) -> dict[str, tuple[Callable[[], Mechanism], int]]:
    """{name: (the change, coordinates after it)}, with numbers that no other version has."""
    n, last, middle = len(base.bodies), base.bodies[-1].name, base.bodies[int(MIDDLE * len(base.bodies))].name
    held = base.lock(middle, angle(version))
    return {
        "detach": (lambda: base.detach(last), n - 1),
        "attach": (lambda: base.attach(tool(version), last), n),
        "lock": (lambda: base.lock(middle, angle(version)), n - 1),
        "unlock": (lambda: held.unlock(middle), n),
    }


def check(what: str, torques: Array, expected: Array, largest: float) -> None:
    """Raise ArithmeticError where torques differ by more, relative to the largest."""
    if not (off := relative_difference(torques, expected)) <= largest:
        raise ArithmeticError(f"{what}: torques differ by {off:.1e} of the largest; rounding is at most {largest:g}")


def reconfiguration(links: int = LINKS, repeats: int = REPEATS) -> Iterator[Table | str]:
    """The table: milliseconds to the first torque, and ratios of shortest times."""
    base = turned_arm(links)
    by_kernels(base)(np.zeros(links))  # the kernels are there
    name = base.bodies[-1].name
    again = base.detach(name).attach(base.subtree(name))
    if cg.structure_hash(inverse_dynamics(again)) != cg.structure_hash(inverse_dynamics(base)):
        raise ArithmeticError("a body that was detached and attached again gives another graph")
    header = ["change", "kernels", "shortest", "full rebuild", "shortest", "ratio", "MuJoCo", "shortest", "ratio"]
    title = f"arm of {links} hinges; milliseconds to the first torque, medians"
    absent: dict[str, str] = {}
    yield Table(title, header, [_row(base, kind, repeats, absent) for kind in changes(base, 0)])
    yield from [f"{name} is not measured: {missing}" for name, missing in absent.items()]


def _row(base: Mechanism, kind: str, repeats: int, absent: dict[str, str]) -> list[str]:
    times: dict[str, list[float]] = {"kernels": [], "rebuild": [], "MuJoCo": []}
    for version in range(repeats):
        change, n = changes(base, version)[kind]
        q, expected = np.linspace(-0.5, 0.5, n), np.empty(0)
        ways: dict[str, Callable[[], Array]] = {"kernels": lambda: by_kernels(change())(q)}  # noqa: B023 (in this turn)
        if version < REBUILDS:
            ways["rebuild"] = lambda: by_rebuild(change())(q)  # noqa: B023
        for who, way in (ways | made({"MuJoCo": partial(_by_mujoco, base, kind, version, q)}, absent)).items():
            taken = spent(way)
            times[who].append(1e3 * taken.seconds)
            if who == "kernels":
                expected = taken.made
            else:
                check(f"{kind}, {who}", taken.made, expected, AGREE if who == "rebuild" else AGREE_MUJOCO)
    least = {who: min(ms) for who, ms in times.items() if ms}
    cells = [kind]
    for who, ms in times.items():
        cells += [f"{statistics.median(ms):.2f}", f"{least[who]:.2f}"] if ms else ["-", "-"]
        if who != "kernels":
            cells.append(f"{least['kernels'] / least[who]:.2g}" if ms else "-")
    return cells


def _by_mujoco(base: Mechanism, kind: str, version: int, q: Array) -> Callable[[], Array]:
    """MuJoCo's edit, compilation and inverse dynamics, made ready. Raises ImportError without MuJoCo."""
    twin = ByMujoco(base, version)
    if kind == "unlock":
        twin.lock()
        twin.torque(q[:-1])

    def work() -> Array:
        getattr(twin, kind)()
        return twin.torque(q)

    return work
