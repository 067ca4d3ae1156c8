"""Inertial numbers: a body's mass, first moment and inertia in the axes of its joint, of which its energy is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cgraph import Node
from cgraph.extend import Array, Builder, building

from ..algebra import spatial
from ..algebra.spatial import Matrix, Triple
from ..body import Body
from ..parameters import symbol


@dataclass(frozen=True, eq=False)
class Link:
    """A body in the axes of its motion: numbers, or nodes that stand for them.

    turn, place: its axes as columns, and its origin at q = 0, in the parent's axes.  moment: m c.  inertia: about the
    origin.  angle: of a hinge, how far the axes are turned about its own beside its coordinate [rad].
    """

    turn: Matrix  # (3, 3)
    place: Triple
    mass: float | Node
    moment: Triple
    inertia: Matrix  # (3, 3), the lower triangle counts
    damping: float | Node
    stiffness: float | Node
    spring_reference: float | Node
    armature: float | Node
    angle: float = 0.0

    @cached_property
    def parallel(self) -> bool:
        """Whether the joint's axis is along that of the parent's joint, or against it."""
        across = (self.turn[0][2], self.turn[1][2], self.turn[2][0], self.turn[2][1])
        return all([float(each) == 0.0 for each in across])

    @cached_property
    def numbers(self) -> list[float | Node]:
        """Turn, place, mass, moment, inertia (lower triangle), damping, stiffness, spring reference, armature."""
        turn = [each for row in self.turn for each in row]
        lower = [self.inertia[i][j] for i in range(3) for j in range(i + 1)]
        others = (self.damping, self.stiffness, self.spring_reference, self.armature)
        return [spatial.plain(each) for each in (*turn, *self.place, self.mass, *self.moment, *lower, *others)]

    @property
    def full_inertia(self) -> list[list[float | Node]]:
        """The inertia with its upper triangle."""
        return [[spatial.plain(self.inertia[max(i, j)][min(i, j)]) for j in range(3)] for i in range(3)]

    def at(self, q: Sequence[Node]) -> Sequence[Node]:
        """The coordinates of the joint by which the axes move."""
        return [q[0] + self.angle] if self.angle else q


def axes_of(body: Body) -> Array:
    """The axes of the body's motion, as columns in the body's; where its joint has an axis, the third is that."""
    return body.joint.type.axes(np.asarray(body.joint.axis))


@dataclass(frozen=True, eq=False)
class MergedBody(Body):
    """A body with others welded to it that are not merged into its inertia, since there are parameters among theirs.

    welded: bodies in the same frame, of which mass, center and inertia count.
    """

    welded: tuple[Body, ...] = ()


def inertia_in(axes: Array, body: Body) -> tuple[Any, Array, Array]:
    """Mass, center of mass (3,), and inertia about the joint (3, 3) of a body alone, in these axes of it."""
    mass, center = symbol(body.mass), spatial.product(axes.T, np.asarray(body.center))
    about_center = spatial.product(axes.T, np.asarray(body.inertia), axes)
    return mass, center, spatial.parallel_axis(about_center, mass, center)


def link(body: Body, outer: Array) -> Link:
    """The link of a body whose parent moves in the axes `outer`."""
    axes, joint = axes_of(body), body.joint
    with building(Builder()):
        turn, place = spatial.joint_placement(outer, joint.orientation, np.asarray(joint.position), axes)
        mass, center, inertia = inertia_in(axes, body)
        moment = mass * center
        for other in body.welded if isinstance(body, MergedBody) else ():
            more, center, about_joint = inertia_in(axes, other)
            mass, moment, inertia = mass + more, moment + more * center, spatial.added(inertia, about_joint)
        moment = spatial.constant(moment)
    damping, stiffness, reference, armature = map(
        symbol, (joint.damping, joint.stiffness, joint.spring_reference, joint.armature)
    )
    return Link(turn.tolist(), place, mass, moment, inertia.tolist(), damping, stiffness, reference, armature)
