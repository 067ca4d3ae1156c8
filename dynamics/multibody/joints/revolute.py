"""Revolute: a hinge, which turns the body about the joint's axis."""

from cgraph import Node

from .joint_type import AxialJoint


class Revolute(AxialJoint):
    """A hinge. Its coordinate is an angle [rad]."""

    kind = "revolute"
    mjcf = "hinge"
    urdf = "continuous"

    def angle(self, x: Node) -> Node:
        """The coordinate itself."""
        return x


JOINT = Revolute()
