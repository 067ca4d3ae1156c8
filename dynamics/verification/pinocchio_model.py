"""Pinocchio on the bodies of a mechanism: its model, our states in it, rnea and aba, constraintDynamics with loops."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, required

from ..multibody.bodies.body import WORLD, Body
from ..multibody.bodies.joint_coordinates import per_velocity, places
from ..multibody.joints import AxialJoint, quaternion
from ..multibody.loops import Loop
from ..multibody.trees.mechanism import Mechanism
from .residual import UnavailableError

if TYPE_CHECKING:
    from pinocchio import SE3, Inertia, JointModel

# Pinocchio's joints for ours; of the first two it has quicker ones where the axis is one of the coordinate axes.
_JOINTS = {
    "revolute": "JointModelRevoluteUnaligned",
    "prismatic": "JointModelPrismaticUnaligned",
    "screw": "JointModelHelicalUnaligned",
    "ball": "JointModelSpherical",
    "free": "JointModelFreeFlyer",
    "free (body axes)": "JointModelFreeFlyer",
}
_ALIGNED = {"revolute": "JointModelR", "prismatic": "JointModelP"}
_WORLD_AXES = "free"  # whose linear velocity is in the axes of the joint, and Pinocchio's in the body's


def pinocchio() -> ModuleType:
    """The pinocchio module. Raises ImportError naming the extra when it is not installed."""
    return required("pinocchio", "Pinocchio is not installed", "pinocchio")


class PinocchioModel:
    """A mechanism in Pinocchio, without damping and springs.

    Its quaternions are (x, y, z, w), of length 1, and a free body's linear velocity is in the body's axes. Functions
    take one state, or many as columns. With R the axes of a free body, v = R v' and a = R (a' + omega x v').
    """

    def __init__(self, mechanism: Mechanism) -> None:
        module = pinocchio()
        self.model = module.Model()
        self.model.gravity.linear = np.asarray(mechanism.gravity, dtype=np.float64)
        ids, bodies = {WORLD: 0}, mechanism.moving
        where = {body.name: place for body, place in zip(bodies, places(bodies), strict=True)}
        self.q_order = np.empty(len(mechanism.coordinates), dtype=int)  # of each of our coordinates, the place in its q
        self.order = np.empty(len(mechanism.velocities), dtype=int)
        self._quaternions: list[slice] = []  # in Pinocchio's q
        self.turned: list[tuple[slice, slice, slice, float]] = []  # of free bodies: v', omega; quaternion; armature
        for body in _depth_first(bodies):
            frame = module.SE3(np.array(body.joint.orientation), np.array(body.joint.position))
            joint = self.model.addJoint(ids[body.parent], _joint(module, body), frame, body.coordinate)
            ids[body.name] = joint
            self.model.appendBodyToJoint(joint, _inertia(module, body), module.SE3.Identity())
            at, u = self.model.joints[joint].idx_q, self.model.joints[joint].idx_v
            end, last = u + len(body.joint.type.velocities), at + len(body.joint.type.coordinates)
            self.model.armature[u:end] = body.joint.armature
            self.order[where[body.name].u] = range(u, end)
            if last - at == 1:
                self.q_order[where[body.name].q] = at
                continue
            first = last - 4
            self.q_order[where[body.name].q] = [*range(at, first), first + 3, first, first + 1, first + 2]
            self._quaternions.append(slice(first, last))
            if body.joint.kind == _WORLD_AXES:
                self.turned.append((slice(u, u + 3), slice(u + 3, u + 6), slice(first, first + 4), body.joint.armature))
        self._q_at, self._at = np.argsort(self.q_order), np.argsort(self.order)

    def q(self, q: Array) -> Array:
        """Pinocchio's q of ours, (nq,) or (nq, k)."""
        result: Array = q[self._q_at].copy()
        for rows in self._quaternions:
            result[rows] /= np.linalg.norm(result[rows], axis=0)
        return result

    def v(self, q: Array, u: Array) -> Array:
        """Pinocchio's velocities, or forces, of ours; q: Pinocchio's."""
        result: Array = u[self._at].copy()
        for linear, _, rows, _ in self.turned:
            result[linear] = np.einsum("ji...,j...->i...", axes(q[rows]), result[linear])
        return result

    def a(self, q: Array, v: Array, a: Array) -> Array:
        """Pinocchio's accelerations of ours; q, v: Pinocchio's."""
        return self.v(q, a) - self.curved(v)

    def curved(self, v: Array) -> Array:
        """omega x v' of free bodies, and zeros."""
        result = np.zeros_like(v)
        for linear, angular, _, _ in self.turned:
            result[linear] = np.cross(v[angular], v[linear], axis=0)
        return result

    def rotor(self, v: Array) -> Array:
        """Force that Pinocchio lacks of the armature of free bodies, which moves along the axes of the joint."""
        result = self.curved(v)
        for linear, _, _, armature in self.turned:
            result[linear] *= armature
        return result

    def our_v(self, q: Array, v: Array) -> Array:
        """Our velocities, or forces, of Pinocchio's."""
        result = v.copy()
        for linear, _, rows, _ in self.turned:
            result[linear] = np.einsum("ij...,j...->i...", axes(q[rows]), v[linear])
        return result[self.order]

    def our_a(self, q: Array, v: Array, a: Array) -> Array:
        """Our accelerations of Pinocchio's."""
        return self.our_v(q, a + self.curved(v))


def _depth_first(bodies: Sequence[Body]) -> Iterator[Body]:
    """The bodies in the order that Pinocchio needs: what a body carries follows it without a gap."""
    stack = [body for body in reversed(bodies) if body.parent == WORLD]
    while stack:
        yield (body := stack.pop())
        stack += [each for each in reversed(bodies) if each.parent == body.name]


def _joint(module: ModuleType, body: Body) -> JointModel:
    """Pinocchio's joint. Raises UnavailableError for a kind that has none."""
    kind = body.joint.kind
    if kind not in _JOINTS:
        raise UnavailableError(f"has no joint of the kind {kind!r}")
    if not isinstance(body.joint.type, AxialJoint):
        return getattr(module, _JOINTS[kind])()
    axis = np.asarray(body.joint.axis)
    if kind not in _ALIGNED:
        return getattr(module, _JOINTS[kind])(axis, body.joint.pitch)
    for name, unit in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return getattr(module, _ALIGNED[kind] + name)()
    return getattr(module, _JOINTS[kind])(axis)


def _inertia(module: ModuleType, body: Body) -> Inertia:
    """Pinocchio's inertia. Raises UnavailableError for one that it does not take, as with a moment of -1e-20."""
    try:
        return module.Inertia(body.mass, np.array(body.center), np.array(body.inertia))
    except (RuntimeError, ValueError) as error:
        raise UnavailableError(f"does not take body {body.name!r}: {error}") from None


def axes(turn: Array) -> Array:
    """The axes, (3, 3) or (3, 3, k), of quaternions (x, y, z, w), (4,) or (4, k)."""
    return np.array(quaternion.rotation(cast(Any, np.roll(turn, 1, axis=0))))


class PinocchioBodies:
    """A mechanism in Pinocchio, asked at our states.

    Damping and springs, which its algorithms leave out, are taken off the torque or added to it. Raises ImportError
    without Pinocchio, and UnavailableError for bodies and joints that it has not.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        if balanced := [link.name for link in mechanism.parts if link.gravity_compensation]:
            raise UnavailableError(f"no gravity compensation, as body {balanced[0]!r} has it")
        self.pinocchio, self.of = pinocchio(), PinocchioModel(mechanism)
        self.model, self.data = self.of.model, self.of.model.createData()
        self.nq, self.n = len(mechanism.coordinates), len(mechanism.velocities)
        moving = mechanism.moving
        self.stiffness = np.array(per_velocity(moving, [body.joint.stiffness for body in moving]))
        self.spring_reference = np.array(per_velocity(moving, [body.joint.spring_reference for body in moving]))
        self.damping = np.array(mechanism.system.damping)
        self.balls = [place for body, place in zip(moving, places(moving), strict=True) if body.joint.kind == "ball"]
        # Where the coordinate of a velocity is; of joints with several, the first.
        self.coordinate = np.array(per_velocity(moving, [place.q.start for place in places(moving)]))

    def _passive(self, q: Array, u: Array) -> Array:
        """The torque of dampers and springs against the motion, in our order; (n,), or with columns."""
        damping, stiffness, rest = (
            each.reshape(-1, *[1] * (u.ndim - 1)) for each in (self.damping, self.stiffness, self.spring_reference)
        )
        stretch = q[self.coordinate] - rest
        for place in self.balls:
            stretch[place.u] = _rotation_vector(q[place.q])
        force: Array = damping * u + stiffness * stretch
        return force

    def arguments(self, x: Array, forward: bool) -> tuple[Array, Array, Array]:
        """q, v and the torque, or else the acceleration, as Pinocchio has them, of x = (q, qd, tau or qdd)."""
        q, u, last = np.split(x, [self.nq, self.nq + self.n])
        theirs = self.of.q(q)
        v = self.of.v(theirs, u)
        if not forward:
            return theirs, v, self.of.a(theirs, v, last)
        return theirs, v, self.of.v(theirs, last - self._passive(q, u)) - self.of.rotor(v)

    def result(self, x: Array, q: Array, v: Array, y: Array, forward: bool) -> Array:
        """Accelerations, or else torques of the motion, as we have them.  q, v: Pinocchio's."""
        if forward:
            return self.of.our_a(q, v, y)
        return self.of.our_v(q, y + self.of.rotor(v)) + self._passive(x[: self.nq], x[self.nq : self.nq + self.n])

    def at(self, x: Array, forward: bool) -> Array:
        """qdd, or else tau, (n,), at one state."""
        algorithm = self.pinocchio.aba if forward else self.pinocchio.rnea
        q, v, last = self.arguments(x, forward)
        return self.result(x, q, v, algorithm(self.model, self.data, q, v, last), forward)

    def inverse(self, at: Mapping[str, Array]) -> Array:
        """tau, (N, n), of q, qd, qdd, (N, n) each."""
        return np.array([self.at(x, False) for x in np.concatenate([at["q"], at["qd"], at["qdd"]], axis=1)])


def _rotation_vector(e: Array) -> Array:
    """Axis times angle [rad], at most pi, of quaternions (w, x, y, z), (4,) or (4, k)."""
    length = np.linalg.norm(e[1:], axis=0)
    angle = 2.0 * np.arctan2(length, np.abs(e[0]))
    result: Array = e[1:] * (np.copysign(angle, e[0]) / np.where(length, length, 1.0))
    return result


_KINDS = {"point": "CONTACT_3D", "weld": "CONTACT_6D"}
_PROXIMAL = 1e-14, 1e-8, 200  # what is left of the constraints, its regularization, and iterations


def constrained_accelerations(mechanism: Mechanism, q: Array, qd: Array, tau: Array) -> Array:
    """qdd, (N, n), at states that meet the loops, without Baumgarte's stabilization.

    Raises ImportError without Pinocchio, and UnavailableError for what it has not.
    """
    for loop in mechanism.loops:
        if loop.kind not in _KINDS:
            raise UnavailableError(f"has no loop of the kind {loop.kind!r}")
    peer = PinocchioBodies(mechanism)
    pin, model, data = peer.pinocchio, peer.model, peer.data
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for loop in mechanism.loops:
        body, to = loop.bodies
        ends = [*_frame(peer, mechanism, body, loop.at), *_frame(peer, mechanism, to, loop.to_at, loop)]
        models.append(pin.RigidConstraintModel(getattr(pin.ContactType, _KINDS[loop.kind]), model, *ends, pin.LOCAL))
        datas.append(models[-1].createData())
    pin.initConstraintDynamics(model, data, models, datas)
    settings, rows = pin.ProximalSettings(*_PROXIMAL), []
    for x in np.concatenate([q, qd, tau], axis=1):
        theirs = peer.arguments(x, True)
        pin.constraintDynamics(model, data, *theirs, models, datas, settings)
        rows.append(peer.of.our_a(*theirs[:2], np.array(data.ddq)))
    return np.array(rows)


def _frame(
    peer: PinocchioBodies, mechanism: Mechanism, body: str, at: ArrayLike, loop: Loop | None = None
) -> tuple[int, SE3]:
    """Pinocchio's joint of a body, and the frame of a loop there.  loop: whose orientation the frame has."""
    carrier = mechanism.carriers[body]
    names = {each.name: each.coordinate for each in mechanism.moving}
    joint = 0 if carrier.name == WORLD else peer.model.getJointId(names[carrier.name])
    turn = np.eye(3) if loop is None else np.asarray(loop.orientation, dtype=np.float64)
    place = carrier.position + carrier.orientation @ np.asarray(at, dtype=np.float64)
    return joint, peer.pinocchio.SE3(carrier.orientation @ turn, place)
