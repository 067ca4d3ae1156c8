"""Joints of a user's own whose directions depend on their coordinates: all that the joints of one axis say of them."""

from collections.abc import Iterator, Sequence
from functools import reduce
from unittest.mock import patch

import numpy as np
from pytest import fixture, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import certify
from dynamics.multibody.algebra import spatial
from dynamics.multibody.algebra.spatial import Triple
from dynamics.multibody.algebra.spatial_vectors import Twist
from dynamics.multibody.joints import TYPES, SpatialJoint
from dynamics.multibody.joints.joint_type import AxialJoint, contradiction
from tests.dynamics.mechanisms import random_body
from tests.dynamics.models import Array

ZERO, ONE = cg.constant(0.0), cg.constant(1.0)
X, Y, Z = range(3)
Nodes = Sequence[cg.Node]


def turn(axis: int, angle: cg.Node) -> list[list[cg.Node]]:
    """About x, y or z."""
    c, s, matrix = cg.cos(angle), cg.sin(angle), [[ONE if i == j else ZERO for j in range(3)] for i in range(3)]
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i][i] = matrix[j][j] = c
    matrix[i][j], matrix[j][i] = -s, s
    return matrix


def along(axis: int, size: cg.Node) -> Triple:
    x, y, z = (size if k == axis else ZERO for k in range(3))
    return x, y, z


class Angles(SpatialJoint):
    """Yaw, pitch and roll, whose rates are the velocities."""

    kind = "angles"
    coordinates = velocities = ("yaw", "pitch", "roll")
    units, velocity_units = ("rad",) * 3, ("rad/s",) * 3
    neutral, groups = (0.0,) * 3, (0, 1, 2)
    hinges = (Z, Y, X)  # the same, one after another

    def rotation(self, q: Nodes) -> list[list[cg.Node]]:
        turns = [turn(axis, x) for axis, x in zip(self.hinges, q, strict=True)]
        return reduce(lambda a, b: [[spatial.dot(tuple(r), tuple(c)) for c in zip(*b, strict=True)] for r in a], turns)

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        omega = spatial.STILL
        for axis, x, rate in zip(self.hinges, q, u, strict=True):
            omega = spatial.plus(spatial.rotate_transpose(turn(axis, x), omega), along(axis, rate))
        return Twist(omega, spatial.STILL)

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        raise NotImplementedError

    def resists(self, mass: float, inertia: Array) -> bool:
        return mass > 0.0


class Still(Angles):
    """With a wrong rate of its angular velocity, as of directions that turn with the body."""

    kind = "still"

    def acceleration(self, q: Nodes, u: Nodes) -> Twist:
        return super().acceleration(q, u)._replace(angular=spatial.STILL)


class Constant(Angles):
    """Said to have directions that turn with the body."""

    kind = "constant"
    turns_with_body = True


class Faster(Angles):
    """With a velocity that its turn has not."""

    kind = "faster"

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        return super().velocity(q, u).scaled(2.0)


class Squared(Angles):
    """With a velocity that is not linear, and rates to it."""

    kind = "squared"

    def rate(self, q: Nodes, u: Nodes) -> Nodes:
        return [x * x for x in u]

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        return super().velocity(q, self.rate(q, u))


class Nowhere(Angles):
    """At no real place."""

    kind = "nowhere"

    def translation(self, q: Nodes) -> Triple:
        return cg.sqrt(-1.0 - q[0] * q[0]), ZERO, ZERO


class Turned(Angles):
    """That is turned from the joint at neutral coordinates."""

    kind = "turned"
    neutral = (0.5, 0.0, 0.0)


class Rail(Angles):
    """A slider on a circle of that radius [m], by how far along x it is, which may turn by so much a radius.

    turned, moved: what its velocities are off by, 1 of a right one.
    """

    kind = "rail"
    coordinates = velocities = ("x",)
    units, velocity_units, neutral, groups = ("m",), ("m/s",), (0.0,), (0,)

    def __init__(self, radius: float, turns: float = 0.0, turned: float = 1.0, moved: float = 1.0) -> None:
        self.radius, self.bend, self.turned, self.moved = radius, turns / radius, turned, moved

    def rotation(self, q: Nodes) -> list[list[cg.Node]]:
        return turn(X, self.bend * q[0])

    def translation(self, q: Nodes) -> Triple:
        return q[0], self.radius - cg.sqrt(self.radius**2 - q[0] * q[0]), ZERO

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        up = self.moved * q[0] * u[0] / cg.sqrt(self.radius**2 - q[0] * q[0])
        linear = spatial.rotate_transpose(self.rotation(q), (u[0], up, ZERO))
        return Twist((self.turned * self.bend * u[0], ZERO, ZERO), linear)


class Bent(Angles):
    """With velocities about axes of the body, whose brackets it does not know."""

    kind = "bent"
    velocities = ("x", "y", "z")

    def rate(self, q: Nodes, u: Nodes) -> Nodes:
        c, s, cosine, sine = cg.cos(q[2]), cg.sin(q[2]), cg.cos(q[1]), cg.sin(q[1])
        yaw = (s * u[1] + c * u[2]) / cosine
        return [yaw, c * u[1] - s * u[2], u[0] + yaw * sine]

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        return Twist((u[0], u[1], u[2]), spatial.STILL)


WRONG = {
    Faster(): "its velocity must be the rate of its turn and translation, along the rates of its coordinates",
    Squared(): "its velocity must be linear in u",
    Still(): "its acceleration must be the rate of its velocity at constant u",
    Nowhere(): "its turn, translation, velocity and rates must be finite about neutral coordinates",
    Turned(): "its turn and translation must be none at neutral coordinates",
    Constant(): "its velocities must be along axes that turn with the body, as it says, at all coordinates",
    Bent(): "structure does not belong to rate",
}


@mark.parametrize("joint", WRONG, ids=lambda joint: joint.kind)
def test_a_type_that_contradicts_itself_is_refused_in_a_sentence(joint: Angles) -> None:
    said_of_b = raises(dyn.MechanismError, match="body 'b': the type of joints of the kind")
    with patch.dict(TYPES, **{joint.kind: joint}), said_of_b as said:
        dyn.Mechanism([dyn.Body("b", dyn.Joint(joint.kind), mass=1.0, inertia=(1.0, 1.0, 1.0))])
    assert WRONG[joint] in str(said.value)


def test_no_type_of_the_library_contradicts_itself() -> None:
    own = [joint.with_pitch(0.3) for joint in TYPES.values() if type(joint).__module__.startswith("dynamics.")]
    assert not [joint.kind for joint in own if joint.moves and contradiction(joint)]
    assert all([joint.turns_with_body for joint in own if joint.moves])  # so that closed forms hold


@mark.parametrize("radius", [1e-9, 0.03, 1.0, 1e3])
def test_a_type_is_judged_where_its_coordinates_are_defined_and_in_any_unit(radius: float) -> None:
    """Angles beside lengths that are a billion times as small, or as large."""
    assert not contradiction(Rail(radius))
    assert not contradiction(Rail(radius, 2.0))
    wrong = "its velocity must be the rate of its turn and translation"
    for joint in (Rail(radius, 2.0, turned=1.01), Rail(radius, 2.0, moved=1.01)):
        assert contradiction(joint).startswith(wrong)


@fixture(autouse=True)
def own_types() -> Iterator[None]:
    with patch.dict(TYPES, **{joint.kind: joint for joint in (Angles(), Still(), Constant())}):
        yield


def with_joint(kind: str) -> dyn.Mechanism:
    """A body on such a joint, anywhere."""
    rng = np.random.default_rng(11)
    joint = dyn.Joint(kind, position=rng.normal(size=3), orientation=spatial.from_quaternion(rng.normal(size=4)))
    return dyn.Mechanism([random_body("b", kind, "world", rng, joint=joint)])


@patch("dynamics.multibody.bodies.body.contradiction", lambda joint: "")
def test_the_certificate_looks_at_bias_and_derivatives() -> None:
    """Of a type of joint that is wrong about itself, and was not refused, each finds its own."""
    said = {
        kind: {each.equation.partition(" ")[0] for each in certify(with_joint(kind), 2).residuals if not each.passed}
        for kind in ("angles", "still", "constant")
    }
    assert said["angles"] == set()
    assert "bias" in said["still"]
    assert said["constant"] == {"derivatives:"}


def test_a_type_that_neither_turns_nor_moves_its_body_is_refused() -> None:
    with raises(TypeError, match="Still gives neither angle nor shift, and so would not move its body"):

        class Still(AxialJoint):
            kind = "still"
