"""Screw: a nut, which the screw's pitch moves along the axis as it turns."""

from dataclasses import dataclass

from cgraph import Node

from .joint_type import AxialJoint, JointType


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


JOINT = Screw()
