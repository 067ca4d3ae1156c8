"""Pinocchio on the bodies of a mechanism: rnea and aba with our damping and springs, constraintDynamics with loops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..multibody.bodies.body import WORLD
from ..multibody.bodies.joint_coordinates import per_velocity, places
from ..multibody.loops import Loop
from ..multibody.trees.mechanism import Mechanism
from .pinocchio_model import PinocchioModel, pinocchio
from .residual import UnavailableError

if TYPE_CHECKING:
    from pinocchio import SE3


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
