"""Revolute: a hinge, which turns the body about the joint's axis."""

from __future__ import annotations

import numpy as np

from cgraph import Node

from .. import spatial
from ..spatial import ZERO, Array


class Revolute:
    """A hinge. Its coordinate is an angle [rad]."""

    kind = "revolute"
    mjcf = "hinge"
    urdf = "continuous"
    moves = True
    unit = "rad"
    turns = True
    limited = False

    def angle(self, x: Node) -> Node:
        """The coordinate itself."""
        return x

    def shift(self, x: Node) -> Node:
        """None: the origin lies on the axis."""
        return ZERO

    def placement(self, axis: Array, at: float) -> tuple[Array, Array]:
        """A rotation about the axis."""
        return spatial.rotation(axis, at), np.zeros(3)

    def resists(self, mass: float, inertia: Array) -> bool:
        """Inertia about the axis."""
        return float(inertia[2, 2]) > 0.0

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The mass, the first moment along the axis, and the inertia that is alike about every axis across."""
        return mass, moment * (0.0, 0.0, 1.0), inertia[1, 1] * np.diag([1.0, 1.0, 0.0])


JOINT = Revolute()
