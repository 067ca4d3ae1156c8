"""JointType: all that the library asks of a type of joint."""

from __future__ import annotations

from typing import Protocol

from cgraph import Node

from ..spatial import Array


class JointType(Protocol):
    """A type of joint with one coordinate, which turns the body about the joint's axis, slides it along, or both.

    kind: the word for it in `Joint.kind`.  mjcf, urdf: the words for it in those files; "" where they have none.
    moves: whether it has a coordinate; of "fixed" no function below is asked but `placement`.
    unit: of the coordinate.  turns: whether it turns the body.  limited: whether URDF demands limits of it.

    Nodes are over the child's axes, in which the joint's axis is z, and stand for their z component.
    """

    kind: str
    mjcf: str
    urdf: str
    moves: bool
    unit: str
    turns: bool
    limited: bool

    def angle(self, x: Node) -> Node:
        """How far the coordinate turns the body [rad]; of its rate, the angular velocity. Linear in it."""

    def shift(self, x: Node) -> Node:
        """How far the coordinate moves the body's origin [m]; of its rate, the velocity. Linear in it."""

    def placement(self, axis: Array, at: float) -> tuple[Array, Array]:
        """Rotation (3, 3) and displacement (3,) [m] of the body at a coordinate, in its axes at 0."""

    def resists(self, mass: float, inertia: Array) -> bool:
        """Whether a body alone has inertia along the coordinate; its inertia is about the joint's origin, (3, 3).

        In the axes in which the joint's axis is z.
        """

    def unobservable(self, mass: float, moment: Array, inertia: Array) -> tuple[float, Array, Array]:
        """The part of mass, first moment (3,) and inertia (3, 3) that moves with the parent whatever the joint does."""
