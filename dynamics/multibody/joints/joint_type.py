"""JointType: all that the library asks of a type of joint; of one axis, or of several freedoms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array, memo
from cgraph.extend import Builder, building, topological

from ...systems.kinematics import ONE, Kinematics, QuasiVelocities, changes, numbered_graph
from ..algebra import spatial
from ..algebra.spatial import STILL, ZERO, Triple, cross, plus
from ..algebra.spatial_vectors import Twist
from ..algebra.turns import UNIT, MatrixTurn, Turn, about_z

NodeMatrix = Sequence[Sequence[Node]]  # (3, 3), rows


class JointType(ABC):
    """A type of joint: coordinates q, (nq,), and velocities u, (n,), how they place and how they move the body.

    kind: the word for it in `Joint.kind`.  mjcf, urdf: the words for it in those files; "" where they have none.
    moves: whether it has a coordinate; of "fixed" no function below is asked but `placement`.
    limited: whether URDF demands limits of it.  geared: whether its velocities can have an inertia of their own, an
    armature.  pitched: whether it needs a `Joint.pitch`, see `with_pitch`.
    sprung: whether it can have a spring.
    has_axis: whether it moves the body about and along `Joint.axis` alone, which is then z of the body's motion: then
    the origin of the body's frame may be anywhere on it.
    sliding: how many of the velocities, the first ones, move the body along the joint's axes, one after another.
    coordinates, velocities: what they are called after the joint's name; "" of a single one, which has the joint's.
    units, velocity_units: of the coordinates, "1" of those without, and of the velocities.
    neutral: the coordinates where the body stands at the joint.
    groups: for each coordinate a number, the same for those that are one quantity.
    """

    kind: str
    mjcf = urdf = ""
    moves = True
    limited = False
    geared = True
    pitched = False
    sprung = False
    has_axis = False
    sliding = 0
    coordinates: tuple[str, ...] = ("",)
    velocities: tuple[str, ...] = ("",)
    units: tuple[str, ...] = ("rad",)
    velocity_units: tuple[str, ...] = ("rad/s",)
    neutral: tuple[float, ...] = (0.0,)
    groups: tuple[int, ...] = (0,)

    @property
    def turns(self) -> bool:
        """Whether the joint turns the body."""
        return True

    @property
    def measured_about_axis(self) -> bool:
        """Whether the coordinate is an angle about the axis and nothing else: axes turned about it are an offset."""
        return False

    def with_pitch(self, pitch: float) -> JointType:
        """The type of a joint with that pitch [m/rad], where joints of the kind differ by it."""
        return self

    def axes(self, axis: Array) -> Array:
        """Axes of the body's motion, as columns in the body's own."""
        return spatial.to_z(axis) if self.has_axis else np.eye(3)

    @abstractmethod
    def turn(self, q: Sequence[Node]) -> Turn:
        """Turn from the axes that the body has at neutral coordinates, the joint's, to those that it has."""

    def translation(self, q: Sequence[Node]) -> Triple:
        """Position of the body's origin in the joint's axes [m]."""
        return STILL

    @abstractmethod
    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """Velocity S(q) u of the body against the joint, in the body's axes [rad/s], [m/s]. Linear in u."""

    def acceleration(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """Acceleration of the body against the joint at constant u: (w_dot, v_dot + w x v) along q_dot = G u."""
        angular, linear = self.velocity(q, u)
        moving = {x: dot for x, dot in zip(q, self.rate(q, u), strict=True) if x.value is None}
        a, b, c, x, y, z = changes(moving, [*angular, *linear])
        return Twist((a, b, c), plus((x, y, z), cross(angular, linear)))

    def columns(self, q: Sequence[Node]) -> list[Twist]:
        """Columns of S(q): how each velocity moves the body."""
        count = len(self.velocities)
        return [self.velocity(q, [ONE if i == k else ZERO for i in range(count)]) for k in range(count)]

    @cached_property
    def turns_with_body(self) -> bool:
        """Whether all columns but those of sliding velocities are constant in the body's axes."""
        q = cg.variables([f"q{k}" for k in range(len(self.coordinates))])
        with building(Builder()):  # which sees that what 0 multiplies is not there
            columns = self.columns(q)[self.sliding :]
        return not {*q} & {*topological([node for column in columns for part in column for node in part])}

    def rate(self, q: Sequence[Node], u: Sequence[Node]) -> Sequence[Node]:
        """Rates of the coordinates, G(q) u."""
        return u

    def structure(self, u: Sequence[Node], p: Sequence[Node]) -> Sequence[Node]:
        """ad(u; p) of the momenta p = dL/du, see `QuasiVelocities`; 0 where velocities are rates of coordinates."""
        return [ZERO] * len(u)

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """Stretch of the joint's spring of stiffness k along the velocities; none where it has no spring.

        The energy is k/2 times the sum of their squares, whose slopes along the velocities they are.
        """
        return []

    def normalized(self, q: Sequence[Node]) -> Sequence[Node]:
        """Coordinates of the same configuration with a quaternion of length 1."""
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

    The body turns by `angle` and moves by `shift`, of which a type of joint gives one or both, linear in the
    coordinate. Raises TypeError for a type that gives neither.
    """

    sprung = True
    has_axis = True

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if cls.moves and cls.angle is AxialJoint.angle and cls.shift is AxialJoint.shift:
            raise TypeError(f"{cls.__name__} gives neither angle nor shift, and so would not move its body")

    @cached_property
    def turns(self) -> bool:
        """Whether a coordinate turns the body."""
        return _at(self.angle, 1.0) != 0.0

    @cached_property
    def slides(self) -> bool:
        """Whether a coordinate moves the body along the axis."""
        return _at(self.shift, 1.0) != 0.0

    @property
    def measured_about_axis(self) -> bool:
        """Whether the coordinate is the angle about the axis and nothing else."""
        return _at(self.angle, 1.0) == 1.0 and not self.slides

    def stretches(self, q: Sequence[Node], reference: float | Node) -> Sequence[Node]:
        """Distance from the coordinate where the spring pulls nowhere."""
        return [q[0] - reference]

    def angle(self, x: Node) -> Node:
        """Angle by which the coordinate turns the body [rad]; of its rate, the angular velocity. Linear in it."""
        return ZERO

    def shift(self, x: Node) -> Node:
        """Distance by which the coordinate moves the body's origin [m]; of its rate, the velocity. Linear in it."""
        return ZERO

    def turn(self, q: Sequence[Node]) -> Turn:
        """About z."""
        return about_z(self.angle(q[0]))

    def translation(self, q: Sequence[Node]) -> Triple:
        """Translation along z."""
        return ZERO, ZERO, self.shift(q[0])

    def velocity(self, q: Sequence[Node], u: Sequence[Node]) -> Twist:
        """About and along z."""
        return Twist((ZERO, ZERO, self.angle(u[0])), (ZERO, ZERO, self.shift(u[0])))

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """A rotation about the axis and a displacement along it."""
        x = float(at[0]) if self.moves else 0.0
        turn = spatial.rotation(axis, _at(self.angle, x)) if self.turns else np.eye(3)
        return turn, axis * (_at(self.shift, x) if self.slides else 0.0)

    def resists(self, mass: float, inertia: Array) -> bool:
        """Mass of what slides, or inertia about the axis of what turns."""
        return bool((self.slides and mass > 0.0) or (self.turns and inertia[2, 2] > 0.0))

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """Part of the inertia that a turn about the axis and a shift along it leave as it is.

        Of what does not slide, the mass and the first moment along the axis; of what turns, the inertia that is alike
        about every axis across, else all of it.
        """
        along = (0.0, 0.0, 1.0) if self.turns else (1.0, 1.0, 1.0)
        alike = inertia[1, 1] * np.diag([1.0, 1.0, 0.0]) if self.turns else inertia
        return (0.0, np.zeros(3), alike) if self.slides else (mass, moment * along, alike)


def _at(function: Callable[[Node], Node], x: float) -> float:
    """The value of `angle` or `shift` at a number."""
    with building(Builder()):
        return float(spatial.plain(function(cg.constant(x))))


class SpatialJoint(JointType):
    """A joint of several freedoms, which turns the body by a matrix."""

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """Placement by rotation and translation."""
        with building(Builder()):
            q = [cg.constant(x) for x in at.tolist()]
            turn = [[spatial.plain(each) for each in row] for row in self.rotation(q)]
            shift = [spatial.plain(each) for each in self.translation(q)]
        return spatial.snapped(np.array(turn, dtype=np.float64)), np.array(shift, dtype=np.float64)

    @abstractmethod
    def rotation(self, q: Sequence[Node]) -> NodeMatrix:
        """The body's axes as columns, in those that it has at neutral coordinates: the joint's."""

    def turn(self, q: Sequence[Node]) -> Turn:
        """Turn by the matrix."""
        return MatrixTurn(self.rotation(q))


TOLERANCE = 1e-9  # of the largest of its kind
RATE_ROUNDING = 1e-13  # of what it is made of, where that cancels
HALVINGS = 60  # of the way from neutral coordinates, until all is finite


@memo(64)
def contradiction(joint: JointType) -> str:
    """A sentence on a type of joint that contradicts itself, at any state; "" of one that does not."""
    q, u, v = (cg.variables([f"{name}{k}" for k in range(len(of))]) for name, of in (
        ("q", joint.coordinates), ("u", joint.velocities), ("v", joint.velocities)))  # fmt: skip
    build = Builder()
    with building(build):
        turn, rate, velocity = joint.turn(q), list(joint.rate(q, u)), joint.velocity(q, u)
        both = joint.velocity(q, [a + b for a, b in zip(u, v, strict=True)])
        apart = velocity.plus(joint.velocity(q, v))
        axes = turn.columns(UNIT)
        placed = [*[node for axis in axes for node in axis], *joint.translation(q)]
        turned = [node for axis in UNIT for node in turn.out(cross(velocity.angular, axis))]  # R (w x e)
        moved = [*turned, *turn.out(velocity.linear)]
        given, derived = joint.acceleration(q, u), JointType.acceleration(joint, q, u)
    rates = changes(dict(zip(q, rate, strict=True)), placed, build)
    claims: list[tuple[str, list[Node], list[Node]]] = [
        ("velocity must be the rate of its turn and translation, along the rates of its coordinates", rates, moved),
        ("velocity must be linear in u", [*both.angular, *both.linear], [*apart.angular, *apart.linear]),
        (
            "acceleration must be the rate of its velocity at constant u",
            [*given.angular, *given.linear],
            [*derived.angular, *derived.linear],
        ),
    ]
    sides = [node for _, first, second in claims for node in (*first, *second)]
    neutral = np.array(joint.neutral)
    away, values = _sample(joint, [*q, *u, *v], [*velocity.angular, *velocity.linear, *placed, *rate, *sides])
    if not np.isfinite(values).all():
        return "its turn, translation, velocity and rates must be finite about neutral coordinates"
    angular, linear, _, shifted, rated, values = np.split(values, np.cumsum([3, 3, 9, 3, len(q)]))
    hurry = max(np.abs(rated / away).max(), np.abs(angular).max())  # 1/s: how fast anything changes
    length = max(np.abs(shifted).max(), np.abs(linear).max() / hurry)  # m
    for power, (text, first, _) in zip((1, 1, 2), claims, strict=True):
        (a, b), values = np.split(values[: 2 * len(first)], 2), values[2 * len(first) :]
        for one, other, size in ((a[:-3], b[:-3], 1.0), (a[-3:], b[-3:], length)):  # angles and lengths: two units
            largest = max(np.abs(one).max(), np.abs(other).max())
            if not np.abs(one - other).max() <= TOLERANCE * largest + RATE_ROUNDING * size * hurry**power:
                return f"its {text}"
    off = np.abs(_values(placed, q, neutral) - np.array([*np.eye(3).ravel(), 0.0, 0.0, 0.0]))
    if not (off[:9].max() <= TOLERANCE and off[9:].max() <= TOLERANCE * np.abs(shifted).max()):
        return "its turn and translation must be none at neutral coordinates"
    if joint.turns_with_body and not JointType.turns_with_body.func(joint):  # type: ignore[attr-defined]
        return "its velocities must be along axes that turn with the body, as it says, at all coordinates"
    return "" if rate == u else _wrong_structure(joint)


def _sample(joint: JointType, inputs: list[Node], nodes: list[Node]) -> tuple[Array, Array]:
    """Distance of coordinates from neutral ones at a state where all nodes are finite, and their values."""
    neutral, sizes, count = np.array(joint.neutral), np.sin(np.arange(1.0, 1.0 + len(inputs)) ** 2), len(joint.neutral)
    for k in range(HALVINGS):
        at = _values(list(joint.normalized(inputs[:count])), inputs[:count], neutral + 0.5 ** (k + 1) * sizes[:count])
        values = _values(nodes, inputs, np.concatenate([at, sizes[count:]]))  # velocities are any numbers
        if np.isfinite(values).all():
            break
    return at - neutral, values


def _wrong_structure(joint: JointType) -> str:
    """The sentence of `Kinematics` on rates and structure, if there is one."""
    names = [f"u{k}" for k in range(len(joint.velocities))]
    quasi = QuasiVelocities(names, joint.rate, joint.structure, joint.neutral, joint.normalized, joint.groups)
    try:
        Kinematics([f"q{k}" for k in range(len(joint.coordinates))], quasi).require_consistent()
    except ValueError as error:
        return str(error)
    return ""


def _values(nodes: list[Node], inputs: list[Node], at: Array) -> Array:
    """Values of nodes, (len(nodes),), at those of the inputs."""
    graph = numbered_graph(inputs, nodes)
    return np.array(list(graph.evaluate(dict(zip(graph.input_names, at.tolist(), strict=True))).values()), dtype=float)
