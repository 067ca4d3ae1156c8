"""JointType: all that the library asks of a type of joint; of one axis, or of several freedoms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph.extend import Array, tangents, topological

from ..algebra.spatial import STILL, ZERO, Triple, cross, plus

NodeMatrix = Sequence[Sequence[Node]]  # (3, 3), rows
ONE = cg.constant(1.0)


class JointType(ABC):
    """A type of joint: coordinates q, (nq,), and velocities u, (n,), how they place and how they move the body.

    kind: the word for it in `Joint.kind`.  mjcf, urdf: the words for it in those files; "" where they have none.
    moves: whether it has a coordinate; of "fixed" no function below is asked but `placement`.
    turns: whether it turns the body.  limited: whether URDF demands limits of it.  geared: whether its velocities can
    have an inertia of their own, an armature.  pitched: whether it needs a `Joint.pitch`, see `with_pitch`.
    sprung: whether it can have a spring.
    coordinates, velocities: what they are called after the joint's name; "" of a single one, which has the joint's.
    units, velocity_units: of the coordinates, "1" of those without, and of the velocities.
    neutral: the coordinates where the body stands at the joint.
    groups: for each coordinate a number, the same for those that are one quantity.
    """

    kind: str
    mjcf = urdf = ""
    moves = True
    turns = True
    limited = False
    geared = True
    pitched = False
    sprung = False
    coordinates: tuple[str, ...] = ("",)
    velocities: tuple[str, ...] = ("",)
    units: tuple[str, ...] = ("rad",)
    velocity_units: tuple[str, ...] = ("rad/s",)
    neutral: tuple[float, ...] = (0.0,)
    groups: tuple[int, ...] = (0,)

    def with_pitch(self, pitch: float) -> JointType:
        """The type of a joint with that pitch [m/rad], where joints of the kind differ by it."""
        return self

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """Rates of the coordinates, G(q) u."""
        return u

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """ad(u; p) of the momenta p = dL/du, see `QuasiVelocities`; 0 where velocities are rates of coordinates."""
        return [ZERO] * len(u)

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """How far the joint's spring of stiffness k is stretched along the velocities; none where it has no spring.

        The energy is k/2 times the sum of their squares, whose slopes along the velocities they are.
        """
        return []

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """The same configuration, with a quaternion of length 1."""
        return q

    @abstractmethod
    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """Rotation (3, 3) and displacement (3,) [m] of the body at coordinates (nq,), in its axes at neutral ones."""

    @abstractmethod
    def resists(self, mass: float, inertia: Array) -> bool:
        """Whether a body alone has inertia along all velocities; its inertia is about the joint's origin, (3, 3).

        In the axes of the body's motion, in which the axis of an axial joint is z.
        """

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The part of mass, first moment (3,) and inertia (3, 3) that moves with the parent whatever the joint does."""
        return 0.0, np.zeros(3), np.zeros((3, 3))


class AxialJoint(JointType):
    """A joint with one coordinate, which turns the body about the joint's axis, slides it along that, or both.

    Nodes are over the child's axes, in which the joint's axis is z, and stand for their z component.
    """

    sprung = True

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """From the coordinate where it pulls nowhere."""
        return [q[0] - reference]

    def angle(self, x: Node) -> Node:
        """How far the coordinate turns the body [rad]; of its rate, the angular velocity. Linear in it."""
        return ZERO

    def shift(self, x: Node) -> Node:
        """How far the coordinate moves the body's origin [m]; of its rate, the velocity. Linear in it."""
        return ZERO


class SpatialJoint(JointType):
    """A joint of several freedoms. Its motion is in the body's axes where nothing else is said.

    sliding: how many of the velocities, the first ones, move the body along the joint's axes, one after another. The
    others are along axes that turn with the body.
    """

    sliding = 0

    @abstractmethod
    def rotation(self, q: Sequence[Node]) -> NodeMatrix:
        """The body's axes as columns, in those that it has at neutral coordinates: the joint's."""

    def translation(self, q: Sequence[Node]) -> Triple:
        """Where the body's origin is, in the joint's axes [m]."""
        return STILL

    @abstractmethod
    def angular_velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """Of the body against the joint [rad/s]."""

    def linear_velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """Of the body's origin against the joint [m/s]."""
        return STILL

    def angular_acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """Of the body against the joint, at constant velocities u [rad/s^2]: the rate of the angular velocity."""
        return self._rate_along(q, u, self.angular_velocity(q, u))

    def linear_acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Triple:
        """Of the body's origin against the joint, at constant velocities u [m/s^2]: v_dot + omega x v."""
        velocity = self.linear_velocity(q, u)
        return plus(self._rate_along(q, u, velocity), cross(self.angular_velocity(q, u), velocity))

    def _rate_along(self, q: Sequence[Node], u: Sequence[Node], vector: Triple) -> Triple:
        """The rate of a vector of nodes over q and u as q moves with u, which is constant."""
        moving = {x: dot for x, dot in zip(q, self.rate(q, u), strict=True) if x.value is None}
        dots = tangents(moving, vector)
        x, y, z = (dots.get(node, ZERO) for node in vector)
        return x, y, z

    @property
    def turns_with_body(self) -> bool:
        """Whether the directions of all velocities but the sliding ones are constant in the body's axes."""
        q, u = cg.variables([f"q{k}" for k in range(len(self.coordinates))]), [ZERO] * len(self.velocities)
        for k in range(self.sliding, len(u)):
            unit = [*u[:k], ONE, *u[k + 1 :]]
            if {*q} & {*topological([*self.angular_velocity(q, unit), *self.linear_velocity(q, unit)])}:
                return False
        return True


MovingJoint = AxialJoint | SpatialJoint  # every type but that of a joint without coordinates


def moving_type(joint: JointType) -> MovingJoint:
    """The type of a joint that has coordinates."""
    assert isinstance(joint, AxialJoint | SpatialJoint)
    return joint
