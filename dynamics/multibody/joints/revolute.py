"""Revolute: a hinge, which turns the body about the joint's axis."""

from __future__ import annotations

import numpy as np

from cgraph import Node
from cgraph.extend import Array

from ..algebra import spatial
from .joint_type import AxialJoint


class Revolute(AxialJoint):
    """A hinge. Its coordinate is an angle [rad]."""

    kind = "revolute"
    mjcf = "hinge"
    urdf = "continuous"
    measured_about_axis = True

    def angle(self, x: Node) -> Node:
        """The coordinate itself."""
        return x

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """A rotation about the axis."""
        return spatial.rotation(axis, float(at[0])), np.zeros(3)

    def resists(self, mass: float, inertia: Array) -> bool:
        """Inertia about the axis."""
        return float(inertia[2, 2]) > 0.0

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The mass, the first moment along the axis, and the inertia that is alike about every axis across."""
        return mass, moment * (0.0, 0.0, 1.0), inertia[1, 1] * np.diag([1.0, 1.0, 0.0])


JOINT = Revolute()
