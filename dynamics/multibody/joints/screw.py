"""Screw: a nut, which the screw's pitch moves along the axis as it turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cgraph import Node
from cgraph.extend import Array

from ..algebra import spatial
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

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        """A rotation about the axis and a displacement along it."""
        return spatial.rotation(axis, float(at[0])), axis * (self.pitch * at[0])

    def resists(self, mass: float, inertia: Array) -> bool:
        """Mass, or inertia about the axis."""
        return mass > 0.0 or float(inertia[2, 2]) > 0.0

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The inertia that is alike about every axis across."""
        return 0.0, np.zeros(3), inertia[1, 1] * np.diag([1.0, 1.0, 0.0])


JOINT = Screw()
