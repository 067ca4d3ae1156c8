"""Twists and wrenches at a point, six nodes each, and their products."""

from __future__ import annotations

from typing import NamedTuple

from cgraph import Node

from .spatial import STILL, Triple, cross, dot, plus, scaled
from .turns import Turn


class Twist(NamedTuple):
    """Twist of a body, its velocity or its acceleration in space: the part of a point of it last."""

    angular: Triple
    linear: Triple

    def plus(self, other: Twist) -> Twist:
        """Sum."""
        return Twist(plus(self.angular, other.angular), plus(self.linear, other.linear))

    def scaled(self, factor: float | Node) -> Twist:
        """Multiple."""
        return Twist(scaled(factor, self.angular), scaled(factor, self.linear))

    def cross(self, other: Twist) -> Twist:
        """The rate of the other, where it is carried along with this velocity: (w x w', w x v' + v x w')."""
        linear = plus(cross(self.angular, other.linear), cross(self.linear, other.angular))
        return Twist(cross(self.angular, other.angular), linear)

    def at(self, offset: Triple) -> Twist:
        """Twist by the motion of a point `offset` away."""
        return Twist(self.angular, plus(self.linear, cross(self.angular, offset)))

    def power(self, wrench: Wrench) -> Node:
        """Power of a wrench along the twist."""
        return dot(self.angular, wrench.torque) + dot(self.linear, wrench.force)


class Wrench(NamedTuple):
    """A torque about a point and a force."""

    torque: Triple
    force: Triple

    def plus(self, other: Wrench) -> Wrench:
        """Sum."""
        return Wrench(plus(self.torque, other.torque), plus(self.force, other.force))

    def carried(self, velocity: Twist) -> Wrench:
        """Rate of a wrench that is carried along with a velocity: (w x n + v x f, w x f)."""
        torque = plus(cross(velocity.angular, self.torque), cross(velocity.linear, self.force))
        return Wrench(torque, cross(velocity.angular, self.force))

    def turned(self, turn: Turn) -> Wrench:
        """Wrench in the axes before a turn."""
        return Wrench(turn.out(self.torque), turn.out(self.force))

    def about(self, offset: Triple) -> Wrench:
        """Wrench about a point from which this one is `offset` away."""
        return Wrench(plus(self.torque, cross(offset, self.force)), self.force)


REST, IDLE = Twist(STILL, STILL), Wrench(STILL, STILL)
