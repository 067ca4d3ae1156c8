"""Fixed: a weld, which has no coordinate."""

from __future__ import annotations

import numpy as np

from cgraph import Node

from ..spatial import ZERO, Array


class Fixed:
    """A weld. The body is merged into the one that carries it."""

    kind = "fixed"
    mjcf = ""
    urdf = "fixed"
    moves = False
    unit = ""
    turns = False
    limited = False

    def angle(self, x: Node) -> Node:
        """None."""
        return ZERO

    def shift(self, x: Node) -> Node:
        """None."""
        return ZERO

    def placement(self, axis: Array, at: float) -> tuple[Array, Array]:
        """Where it is at 0."""
        return np.eye(3), np.zeros(3)

    def resists(self, mass: float, inertia: Array) -> bool:
        """False: nothing moves."""
        return False

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """All of it."""
        return mass, moment, inertia


JOINT = Fixed()
