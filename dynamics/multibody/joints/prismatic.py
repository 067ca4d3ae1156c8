"""Prismatic: a slide, which moves the body along the joint's axis."""

from __future__ import annotations

import numpy as np

from cgraph import Node

from ..spatial import ZERO, Array


class Prismatic:
    """A slide. Its coordinate is a length [m]."""

    kind = "prismatic"
    mjcf = "slide"
    urdf = "prismatic"
    moves = True
    unit = "m"
    turns = False
    limited = True

    def angle(self, x: Node) -> Node:
        """None: the body keeps its orientation."""
        return ZERO

    def shift(self, x: Node) -> Node:
        """The coordinate itself."""
        return x

    def placement(self, axis: Array, at: float) -> tuple[Array, Array]:
        """A displacement along the axis."""
        return np.eye(3), axis * at

    def resists(self, mass: float, inertia: Array) -> bool:
        """Mass."""
        return mass > 0.0

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The inertia: the body turns as its parent does."""
        return 0.0, np.zeros(3), inertia


JOINT = Prismatic()
