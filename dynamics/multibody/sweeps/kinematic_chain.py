"""Kinematic chains: where points and directions of a body are, in the world or on a body inwards, and how they move."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array

from ..algebra import spatial
from ..algebra.spatial import STILL, Triple, plus
from ..algebra.turns import in_a_row
from ..bodies.body import WORLD, Body
from .kinematic_tree import Carrier
from .links import LinkState, motion_axes


class PointMotion(NamedTuple):
    """Motion of a point fixed to a body, in the world's axes."""

    position: Triple
    velocity: Triple
    omega: Triple  # angular velocity of the body


@dataclass(frozen=True, eq=False)
class KinematicChain:
    """The joints between a frame of a body and a body inwards, or the world.

    position, orientation: of the frame in the first link's.  steps: the links, that of the frame first.  axes: of the
    link inwards, as columns in its body's.
    """

    position: Array  # (3,) [m]
    orientation: Array  # (3, 3)
    steps: tuple[LinkState, ...]
    axes: Array  # (3, 3)

    def columns(self) -> list[Triple]:
        """The body's axes in the world's."""
        return [self.direction(spatial.constant(axis)) for axis in np.eye(3)]

    def direction(self, vector: Triple) -> Triple:
        """A vector in the body's axes, in the world's."""
        vector = spatial.rotate_transpose(self.orientation.T.tolist(), vector)
        for step in self.steps:
            vector = spatial.rotate(step.link.turn, step.turn.out(vector))
        return vector

    def motion(self, at: ArrayLike) -> PointMotion:
        """Motion of the point `at`, (3,) in the body's frame: summed from the body to the world."""
        point = spatial.constant(spatial.placed(self.position, self.orientation, at))
        velocity, omega = STILL, STILL
        for step in self.steps:
            place, turn, (turning, sliding) = step.place, step.turn, step.joint.velocity(step.moved, step.u)
            (u, v, w), (a, b, c), (x, y, z) = velocity, turning, point
            velocity = plus((u + b * z - c * y, v + c * x - a * z, w + a * y - b * x), sliding)
            omega = plus(omega, turning)
            point, velocity, omega = (
                spatial.rotate(step.link.turn, turn.out(vector)) for vector in (point, velocity, omega)
            )
            point = plus(place, point)
        return PointMotion(point, velocity, omega)

    def graph(self, at: ArrayLike, q: Sequence[Node], qd: Sequence[Node]) -> Graph:
        """The motion of a point and the body's axes: outputs x, y, z, vx, vy, vz, wx, wy, wz, R_0_0, R_0_1, .. ."""
        point, columns = self.motion(at), self.columns()
        outputs = dict(zip(("x", "y", "z"), point.position, strict=True))
        outputs |= dict(zip(("vx", "vy", "vz"), point.velocity, strict=True))
        outputs |= dict(zip(("wx", "wy", "wz"), point.omega, strict=True))
        outputs |= {f"R_{i}_{j}": columns[j][i] for i in range(3) for j in range(3)}
        return cg.simplify(Graph([*q, *qd], outputs))

    def place_of(self, at: ArrayLike) -> Triple:
        """Position of a point of the frame in the frame of the body inwards [m]."""
        point = spatial.constant(spatial.placed(self.position, self.orientation, at))
        return self._inwards(point, points=True)

    def axis(self, vector: Array) -> Triple:
        """A vector in the frame's axes, in those of the body inwards."""
        return self._inwards(spatial.constant(spatial.product(self.orientation, vector)), points=False)

    def lengths(self, at: ArrayLike) -> list[float]:
        """Lengths [m] that the place of a point is made of."""
        last = spatial.placed(self.position, self.orientation, at)
        links = [np.array([each.value for each in step.link.place]) for step in reversed(self.steps)]
        return [float(np.linalg.norm(each)) for each in (last, *links)]

    def _inwards(self, vector: Triple, *, points: bool) -> Triple:
        """A point or a vector of the last link, in the axes of the body inwards."""
        for run in reversed(self._runs()):
            vector = _through(run, vector, points)
        return spatial.rotate(self.axes.tolist(), vector)

    def _runs(self) -> list[list[LinkState]]:
        """The links outwards, those about one axis that no constant turn separates together."""
        runs: list[list[LinkState]] = []
        for step in reversed(self.steps):
            along = step.joint.has_axis and np.array_equal(np.asarray(step.link.turn), np.eye(3))
            if runs and along and runs[-1][-1].joint.has_axis:
                runs[-1].append(step)
            else:
                runs.append([step])
        return runs


def _through(run: Sequence[LinkState], vector: Triple, points: bool) -> Triple:
    """A point or a vector of a run's last link, in the axes before its first: each link by its angle in the plane."""
    first, total, turn = run[0], STILL, run[0].turn
    for step in run[1:]:
        if points:
            total = plus(total, turn.out(step.place))
        turn = in_a_row(turn, step.turn)
    total = spatial.rotate(first.link.turn, plus(total, turn.out(vector)))
    return plus(first.place, total) if points else total


def kinematic_chains(
    carriers: Sequence[Carrier], moving: Sequence[Body], states: Sequence[LinkState]
) -> list[KinematicChain]:
    """The chains from frames that `carriers` carry to the nearest body that carries them all, or the world.

    states: of the links of the moving bodies.
    """
    index = {body.name: i for i, body in enumerate(moving)}
    paths = [[carrier.name] for carrier in carriers]  # a body and those that carry it, to the world
    for path in paths:
        while path[-1] in index:
            path.append(moving[index[path[-1]]].parent)
    common = next(name for name in paths[0] if all([name in path for path in paths]))
    needed = {common, *[carrier.name for carrier in carriers]}
    axes = {name: np.eye(3) if name == WORLD else motion_axes(moving[index[name]].joint) for name in needed}
    result = []
    for carrier, path in zip(carriers, paths, strict=True):
        steps = tuple([states[index[name]] for name in path[: path.index(common)]])
        own = axes[carrier.name]
        orientation = spatial.snapped(own.T @ carrier.orientation)
        result.append(KinematicChain(spatial.product(own.T, carrier.position), orientation, steps, axes[common]))
    return result
