"""Prismatic: a slide, which moves the body along the joint's axis."""

from __future__ import annotations

import numpy as np

from cgraph import Node
from cgraph.extend import Array

from .joint_type import AxialJoint


class Prismatic(AxialJoint):
    """A slide. Its coordinate is a length [m]."""

    kind = "prismatic"
    mjcf = "slide"
    urdf = "prismatic"
    turns = False
    units = ("m",)
    velocity_units = ("m/s",)
    limited = True

    def shift(self, x: Node) -> Node:
        """The coordinate itself."""
        return x

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """A displacement along the axis."""
        return np.eye(3), axis * at[0]

    def resists(self, mass: float, inertia: Array) -> bool:
        """Mass."""
        return mass > 0.0

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The inertia: the body turns as its parent does."""
        return 0.0, np.zeros(3), inertia


JOINT = Prismatic()
