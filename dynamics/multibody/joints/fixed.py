"""Fixed: a weld, which has no coordinate."""

from __future__ import annotations

import numpy as np

from cgraph.extend import Array

from .joint_type import AxialJoint


class Fixed(AxialJoint):
    """A weld. The body is merged into the one that carries it."""

    kind = "fixed"
    urdf = "fixed"
    moves = False
    turns = False
    coordinates = velocities = units = velocity_units = ()
    neutral = groups = ()

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """Where it is at 0."""
        return np.eye(3), np.zeros(3)

    def resists(self, mass: float, inertia: Array) -> bool:
        """False: nothing moves."""
        return False

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """All of it."""
        return mass, moment, inertia


JOINT = Fixed()
