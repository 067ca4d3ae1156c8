"""Prismatic: a slide, which moves the body along the joint's axis."""

from cgraph import Node

from .joint_type import AxialJoint


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


JOINT = Prismatic()
