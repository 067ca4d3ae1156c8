"""Agreement with MuJoCo and Pinocchio, and which term of the model explains it where there is none."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..equations.equations_of_motion import forward_dynamics
from ..equations.formulations.formulations import inverse_dynamics
from ..equations.states.evaluate import evaluate
from ..io.load import compiled
from ..io.mujoco_module import mujoco
from ..io.mujoco_twin import MujocoTwin, joint_order
from ..io.smooth_forces import input_places
from ..multibody.bodies.body import MechanismError
from ..multibody.changes.pruning import without_effect
from ..multibody.forces.contact import Force
from ..multibody.forces.joint_force import Actuator, JointSpring
from ..multibody.trees.mechanism import Mechanism, as_mechanism
from ..multibody.trees.structure import changed
from ..systems.model import Model
from .pinocchio_model import PinocchioBodies, constrained_accelerations
from .residual import PEERS, PROXIMAL, Residual, UnavailableError

if TYPE_CHECKING:
    from mujoco import MjModel

    from ..io.load import Source

ASKED = 4  # states at which a disagreement is explained
TAKEN = 2  # terms at most that are taken out together
TINY_MASS = 2.0**-40  # of the heaviest body: a mass that weighs nothing beside what is left


class Sizes(NamedTuple):
    """Stand-ins for masses and inertias that differ: little mass, and the inertia of a body of the model."""

    mass: float  # kg; bodies that have no more are without mass
    inertia: float  # kg m^2


def sizes_of(mechanism: Mechanism) -> Sizes:
    """The sizes that go with a mechanism."""
    bodies = [(float(body.mass), np.asarray(body.center), np.asarray(body.inertia)) for body in mechanism.moving]
    inertia = max(float(np.abs(moments).max() + mass * center @ center) for mass, center, moments in bodies)
    return Sizes(TINY_MASS * max(float(body.mass) for body in mechanism.bodies), inertia)


class Term(NamedTuple):
    """A term of the equations, and how MuJoCo's model of a file and our mechanism are made alike in it."""

    theirs: Callable[[MjModel, Sizes], object]
    ours: Callable[[Mechanism, Sizes], Mechanism] = lambda mechanism, sizes: mechanism


def _zeroed(*fields: str) -> Callable[[MjModel, Sizes], None]:
    """MuJoCo's fields to zero, those that its version has."""

    def change(mj: MjModel, sizes: Sizes) -> None:
        for name in fields:
            of = mj.opt if hasattr(mj.opt, name) else mj
            if hasattr(of, name):
                setattr(of, name, 0.0 * getattr(of, name))

    return change


def _switched_off(effect: str, *fields: str) -> Term:
    """One of `EFFECTS`, and its fields in MuJoCo."""
    return Term(_zeroed(*fields), lambda mechanism, sizes: cast("Mechanism", without_effect(mechanism, effect)))


def _heavy(value: str, field: str, count: int) -> Term:
    """A stand-in of `Sizes` for a number of all bodies that have mass."""

    def ours(mechanism: Mechanism, sizes: Sizes) -> Mechanism:
        stand_in = getattr(sizes, field)
        changes: dict[str, Any] = {field: (stand_in,) * count if count > 1 else stand_in}
        bodies = [replace(body, **changes) if float(body.mass) > sizes.mass else body for body in mechanism.bodies]
        return replace(mechanism, bodies=tuple(bodies))

    def theirs(mj: MjModel, sizes: Sizes) -> None:
        getattr(mj, value)[mj.body_mass > sizes.mass] = getattr(sizes, field)

    return Term(theirs, ours)


def _unbound(mj: MjModel, sizes: Sizes) -> None:
    mj.opt.disableflags |= mujoco().mjtDisableBit.mjDSBL_EQUALITY


TERMS: dict[str, Term] = {
    "damping": _switched_off("damping", "dof_damping", "dof_dampingpoly"),
    "joint springs": _switched_off("springs", "jnt_stiffness", "jnt_stiffnesspoly"),
    "armature": _switched_off("armature", "dof_armature"),
    "gravity": _switched_off("gravity", "gravity"),
    "inertia about the centers of mass": _heavy("body_inertia", "inertia", 3),
    "mass and its place": _heavy("body_mass", "mass", 1),
    "tendons": Term(_zeroed("tendon_stiffness", "tendon_damping", "tendon_armature")),
    "equality constraints": Term(_unbound),
    "fluid": Term(_zeroed("density", "viscosity")),
}


def without(mechanism: Mechanism, terms: Sequence[str], sizes: Sizes) -> Mechanism:
    """The mechanism with these of the `TERMS` taken out, or made alike for all."""
    for name in terms:
        mechanism = TERMS[name].ours(mechanism, sizes)
    return mechanism


class Translation:
    """A peer on our mechanism, which `make` gives it."""

    def __init__(self, make: Callable[[Mechanism], Original | PinocchioBodies], mechanism: Mechanism) -> None:
        self.make, self.mechanism = make, mechanism
        self.inverse = make(mechanism).inverse

    def without(self, terms: Sequence[str], sizes: Sizes) -> Translation:
        """The model with these of the `TERMS` taken out."""
        return Translation(self.make, without(self.mechanism, terms, sizes))


class Original:
    """MuJoCo on a model of its own: of a file, say.

    q_order, order: of our coordinates and velocities in its.  mechanism: what is compared.  ctrl: inputs, (nu,).
    """

    def __init__(
        self, mj: MjModel, orders: tuple[Sequence[int], Sequence[int]], mechanism: Mechanism, ctrl: ArrayLike = ()
    ) -> None:
        self.mj, self.orders, self.mechanism, self.ctrl = mj, orders, mechanism, ctrl
        self.q_order, self.order = map(list, orders)
        mj.body_sameframe[:] = 0  # by itself MuJoCo takes frames that are less than 1e-6 apart for one

    def inverse(self, at: Mapping[str, Array]) -> Array:
        """tau, (N, n), of q, qd, qdd, (N, n) each."""
        module, data = mujoco(), mujoco().MjData(self.mj)
        data.ctrl[:] = self.ctrl if self.mj.nu else 0.0
        rows = []
        for q, qd, qdd in zip(at["q"], at["qd"], at["qdd"], strict=True):
            data.qpos[self.q_order], data.qvel[self.order], data.qacc[self.order] = q, qd, qdd
            module.mj_inverse(self.mj, data)
            for stage in (module.mj_fwdPosition, module.mj_fwdVelocity, module.mj_fwdActuation):
                stage(self.mj, data)
            rows.append((data.qfrc_inverse - data.qfrc_actuator)[self.order])
        return np.array(rows)

    def without(self, terms: Sequence[str], sizes: Sizes) -> Original:
        """The model with these of the `TERMS` taken out."""
        mj = copy.copy(self.mj)
        for name in terms:
            TERMS[name].theirs(mj, sizes)
        mujoco().mj_setConst(mj, mujoco().MjData(mj))
        return Original(mj, self.orders, self.mechanism, self.ctrl)


def twin_of(mechanism: Mechanism) -> Original:
    """MuJoCo on the model as `to_mjcf` writes it."""
    twin = MujocoTwin(mechanism)
    return Original(twin.model, joint_order(twin.model, mechanism), mechanism)


def peers(model: Model, twin: Original | None = None) -> Iterator[tuple[str, Callable[[], Translation | Original]]]:
    """Name of each peer, and what makes it for a model: raises UnavailableError with the reason.

    twin: MuJoCo's, in place of the translation.
    """
    yield "MuJoCo", lambda: twin or _translated(twin_of, model)
    yield "Pinocchio", lambda: _translated(PinocchioBodies, model)


def residual(name: str, peer: Translation | Original, at: Mapping[str, Array]) -> Residual:
    """Difference of the inverse dynamics of a peer from ours, with the terms that explain it where it is too large."""
    bodies = peer.mechanism
    value = disagreement(bodies, peer, at)
    note = "" if value <= PEERS.value else explanation(bodies, peer, at)
    return Residual(f"inverse dynamics = {name}'s", value, PEERS, note)


def explanation(model: Mechanism, peer: Translation | Original, at: Mapping[str, Array]) -> str:
    """The one or two of the `TERMS` without which there is agreement, in words."""
    few, sizes = {name: rows[:ASKED] for name, rows in at.items()}, sizes_of(model)
    for count in range(1, TAKEN + 1):
        for terms in combinations(TERMS, count):
            with suppress(MechanismError):  # what is left may be a model that a peer cannot have
                if disagreement(without(model, terms, sizes), peer.without(terms, sizes), few) <= PEERS.value:
                    return f"they agree without {' and '.join(terms)}"
    return f"no {TAKEN} terms explain it"


def disagreement(model: Mechanism, peer: Translation | Original, at: Mapping[str, Array]) -> float:
    """The largest difference of the torques, relative to the largest torque of its state; over all states."""
    return _off(evaluate(model, inverse_dynamics(model), at), peer.inverse(at))


def _off(ours: Array, theirs: Array) -> float:
    """The largest difference of rows (N, n), relative to the largest of ours in its row."""
    size = np.maximum(np.abs(ours).max(axis=1), np.finfo(float).tiny)
    return float(np.max(np.abs(ours - theirs).max(axis=1) / size))


def with_loops(model: Model, at: Mapping[str, Array]) -> tuple[list[Residual], list[str]]:
    """Differences of accelerations with constraints from those of peers, and sentences on what is not compared.

    at: states that meet the constraints.
    """
    said = ["MuJoCo: its equality constraints are soft, so that it is compared without the loops"]
    try:
        bodies = bare(model, loops=True)
    except UnavailableError as error:
        return [], [f"MuJoCo and Pinocchio with constraints: {error}"]
    try:
        theirs = constrained_accelerations(bodies, at["q"], at["qd"], at["tau"])
    except (ImportError, UnavailableError) as error:
        return [], [*said, f"Pinocchio's constraintDynamics: {error}"]
    ours = evaluate(bodies, forward_dynamics(bodies), at)[:, : theirs.shape[1]]
    equation = "forward dynamics with loops = Pinocchio's constraintDynamics"
    return [Residual(equation, _off(ours, theirs), PROXIMAL)], said


def bare(model: Model, kept: Sequence[type] = (), *, loops: bool = False) -> Mechanism:
    """The mechanism of a model, with parameters as numbers, and of forces, which peers do not have, those `kept`.

    loops: whether it has them; they are no part of inverse dynamics. Raises UnavailableError for another model.
    """
    bodies = as_mechanism(model)
    if bodies is None:
        raise UnavailableError("takes rigid bodies, not a Lagrangian")
    bodies = bodies.bind()
    forces = [force for force in bodies.forces if isinstance(force, tuple(kept))]
    bodies = changed(bodies, forces=forces) if bodies.forces else bodies
    return bodies if loops or not bodies.loops else replace(bodies, loops=())


def _translated(make: Callable[[Mechanism], Original | PinocchioBodies], model: Model) -> Translation:
    try:
        return Translation(make, bare(model))
    except (ImportError, UnavailableError, MechanismError) as error:
        raise UnavailableError(str(error)) from None


def original(twin: Source, model: Model) -> Original:
    """MuJoCo on a model, MJCF or URDF, with the coordinates of the model.

    Raises ValueError for a twin that cannot be read or has another number of coordinates, and for a model that is not
    of rigid bodies.
    """
    module, theirs = mujoco(), copy.copy(compiled(twin))
    ctrl, named = np.random.default_rng(0).normal(size=theirs.nu), input_places(theirs)
    given = as_mechanism(model)
    known = given.parameter_values if given else {}
    taken = {name: float(ctrl[k]) for name, k in named.items() if name in known}
    try:
        bodies = bare(given.bind(taken) if given else model, (Actuator, JointSpring, Force))
    except UnavailableError as error:
        raise ValueError(f"a twin is compared with rigid bodies: MuJoCo {error}") from None
    for i in [i for i, name in enumerate(named) if name not in taken]:
        theirs.actuator_gaintype[i] = theirs.actuator_biastype[i] = theirs.actuator_dyntype[i] = 0
        theirs.actuator_gainprm[i], theirs.actuator_biasprm[i] = 0.0, 0.0
    loops = getattr(as_mechanism(model), "loops", ())
    nq, n = len(bodies.coordinates), len(bodies.velocities)
    if (theirs.nq, theirs.nv) != (nq, n):
        raise ValueError(f"the twin has {theirs.nv} degrees of freedom, the model {n}")
    for unused in ("CONTACT", "LIMIT", "FRICTIONLOSS", *["EQUALITY"] * bool(loops)):
        theirs.opt.disableflags |= getattr(module.mjtDisableBit, f"mjDSBL_{unused}")
    names = {theirs.joint(i).name for i in range(theirs.njnt)}
    if names != {body.coordinate for body in bodies.moving}:
        return Original(theirs, (range(nq), range(n)), bodies, ctrl)
    return Original(theirs, joint_order(theirs, bodies), bodies, ctrl)
