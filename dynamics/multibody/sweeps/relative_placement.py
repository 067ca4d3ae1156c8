"""Relative placements: where points and directions of a body are, in the axes of a body that carries it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph.extend import Array

from ..algebra import spatial
from ..algebra.spatial import STILL, Triple
from ..algebra.turns import in_a_row
from ..body import Body
from ..joint_coordinates import parts
from .forward_kinematics import Step
from .kinematic_tree import Carrier
from .links import Link, axes_of
from .outward import joint_translation


@dataclass(frozen=True, eq=False)
class RelativePlacement:
    """The joints between a body that carries, and a frame of a body carried.

    position, orientation: of the frame in the last link's.  steps: of the joints, the carrying body's side first.
    axes: of the carrying body's link, as columns in the body's.
    """

    position: Array  # (3,) [m]
    orientation: Array  # (3, 3)
    steps: tuple[Step, ...]
    axes: Array  # (3, 3)

    def point(self, at: ArrayLike) -> Triple:
        """Where a point of the frame is, in the carrying body's frame [m]."""
        point = spatial.constant(spatial.placed(self.position, self.orientation, at))
        return self._outwards(point, points=True)

    def direction(self, vector: Array) -> Triple:
        """A vector in the frame's axes, in the carrying body's."""
        return self._outwards(spatial.constant(spatial.product(self.orientation, vector)), points=False)

    def lengths(self, at: ArrayLike) -> list[float]:
        """Lengths [m] that the place of a point is made of."""
        last = spatial.placed(self.position, self.orientation, at)
        links = [np.array([each.value for each in step.link.place]) for step in self.steps]
        return [float(np.linalg.norm(each)) for each in (last, *links)]

    def _outwards(self, vector: Triple, *, points: bool) -> Triple:
        """A point or a vector of the last link, in the carrying body's axes."""
        for run in reversed(self._runs()):
            vector = _through(run, vector, points)
        return spatial.rotate(self.axes.tolist(), vector)

    def _runs(self) -> list[list[Step]]:
        """The steps, those about one axis that no constant turn separates together."""
        runs: list[list[Step]] = []
        for step in self.steps:
            axial = step.joint.has_axis and np.array_equal(np.asarray(step.link.turn), np.eye(3))
            if runs and axial and runs[-1][-1].joint.has_axis:
                runs[-1].append(step)
            else:
                runs.append([step])
        return runs


def _through(run: Sequence[Step], vector: Triple, points: bool) -> Triple:
    """A point or a vector of a run's last link, in the axes before its first: each link by its angle in the plane."""
    first, total, turn = run[0], STILL, run[0].joint.turn(run[0].q)
    for step in run[1:]:
        if points:
            total = spatial.plus(total, turn.out(joint_translation(step.link, step.joint, step.q)))
        turn = in_a_row(turn, step.joint.turn(step.q))
    total = spatial.rotate(first.link.turn, spatial.plus(total, turn.out(vector)))
    return spatial.plus(joint_translation(first.link, first.joint, first.q), total) if points else total


def relative_placements(
    carriers: Sequence[Carrier], moving: Sequence[Body], links: Sequence[Link], q: Sequence[Node]
) -> list[RelativePlacement]:
    """The placements of frames that `carriers` carry, in the frame of the nearest body that carries them all.

    links and q are those of the moving bodies.
    """
    index: Mapping[str, int] = {body.name: i for i, body in enumerate(moving)}
    paths = [_path(carrier.name, moving, index) for carrier in carriers]
    common = next(name for name in paths[0] if all([name in path for path in paths]))
    axes = axes_of(moving[index[common]]) if common in index else np.eye(3)
    states = parts(moving, q, q)
    result = []
    for carrier, path in zip(carriers, paths, strict=True):
        names = path[: path.index(common)]
        steps = [Step(links[index[each]], moving[index[each]].joint.type, states[index[each]][0], ()) for each in names]
        own = axes_of(moving[index[carrier.name]]) if carrier.name in index else np.eye(3)
        orientation = spatial.snapped(own.T @ carrier.orientation)
        result.append(
            RelativePlacement(spatial.product(own.T, carrier.position), orientation, tuple(steps[::-1]), axes)
        )
    return result


def _path(name: str, moving: Sequence[Body], index: Mapping[str, int]) -> list[str]:
    """A moving body and those that carry it, to the world."""
    path = [name]
    while path[-1] in index:
        path.append(moving[index[path[-1]]].parent)
    return path
