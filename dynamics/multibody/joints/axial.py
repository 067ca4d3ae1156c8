"""Joints of one axis, hinge, slide, screw and weld, and those that are several of these, one after another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from cgraph import Node

from .joint_type import AxialJoint, JointType


class Revolute(AxialJoint):
    """A hinge. Its coordinate is an angle [rad]."""

    kind = "revolute"
    mjcf = "hinge"
    urdf = "continuous"

    def angle(self, x: Node) -> Node:
        """The coordinate itself."""
        return x


class Prismatic(AxialJoint):
    """A slide. Its coordinate is a length [m]."""

    kind = "prismatic"
    mjcf = "slide"
    urdf = "prismatic"
    units = ("m",)
    velocity_units = ("m/s",)
    limited = True

    def shift(self, x: Node) -> Node:
        """The coordinate itself."""
        return x


@dataclass(frozen=True)
class Screw(AxialJoint):
    """A hinge that moves the body along its axis as it turns, by the pitch [m/rad]. Its coordinate is an angle [rad].

    Screws of one pitch are one type.
    """

    pitch: float = 0.0

    kind = "screw"
    pitched = True

    def with_pitch(self, pitch: float) -> JointType:
        """The screw of that pitch."""
        return Screw(pitch)

    def angle(self, x: Node) -> Node:
        """The coordinate itself."""
        return x

    def shift(self, x: Node) -> Node:
        """The pitch times the coordinate."""
        return self.pitch * x


class Fixed(AxialJoint):
    """A weld. The body is merged into the one that carries it."""

    kind = urdf = "fixed"
    moves = False
    coordinates = velocities = units = velocity_units = ()
    neutral = groups = ()


REVOLUTE, PRISMATIC, SCREW, FIXED = Revolute(), Prismatic(), Screw(), Fixed()


AXIS, SECOND, THIRD = range(3)  # the joint's axis, its second axis, and what is across both, axis x second


class Part(NamedTuple):
    """One of the joints, from the parent outwards."""

    name: str  # what its coordinate is called after the name of the whole
    kind: str
    along: int  # AXIS, SECOND or THIRD


COMPOSITIONS = {
    "cylindrical": (Part("shift", "prismatic", AXIS), Part("angle", "revolute", AXIS)),
    "universal": (Part("angle1", "revolute", AXIS), Part("angle2", "revolute", SECOND)),
    "planar": (Part("x", "prismatic", SECOND), Part("y", "prismatic", THIRD), Part("angle", "revolute", AXIS)),
}
