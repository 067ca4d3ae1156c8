"""Turns of axes as nodes: about one axis, by cosine and sine, or by a matrix."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array
from cgraph.extend import as_node

from . import spatial
from .spatial import ZERO, Matrix, Triple, combined, plus, scaled

NEXT = ((1, 2), (2, 0), (0, 1))  # the two axes across each
Axes = tuple[Triple, Triple, Triple]  # columns
UNIT: Axes = tuple([spatial.constant(row) for row in np.eye(3)])  # type: ignore[assignment]


class AxisTurn(NamedTuple):
    """Turn R about one of the axes: components (a, b) across it become R (a, b) = (c a - s b, s a + c b) outwards."""

    axis: int
    cos: Node
    sin: Node
    angle: Node  # [rad]

    @property
    def still(self) -> bool:
        """Whether nothing turns."""
        return self.cos.value == 1.0 and self.sin.value == 0.0

    @property
    def reversed(self) -> AxisTurn:
        """R^T."""
        return AxisTurn(self.axis, self.cos, -self.sin, -self.angle)

    def into(self, vector: Triple) -> Triple:
        """R^T v: components in the turned axes."""
        (i, j), new = NEXT[self.axis], list(vector)
        new[i], new[j] = self.cos * vector[i] + self.sin * vector[j], self.cos * vector[j] - self.sin * vector[i]
        return new[0], new[1], new[2]

    def out(self, vector: Triple) -> Triple:
        """R v: components in the axes before the turn."""
        (i, j), new = NEXT[self.axis], list(vector)
        new[i], new[j] = self.cos * vector[i] - self.sin * vector[j], self.sin * vector[i] + self.cos * vector[j]
        return new[0], new[1], new[2]

    def columns(self, axes: Axes) -> Axes:
        """A R: the turned axes as columns, where A are those before."""
        (i, j), new = NEXT[self.axis], list(axes)
        new[i] = plus(scaled(self.cos, axes[i]), scaled(self.sin, axes[j]))
        x, y, z = (self.cos * b - self.sin * a for a, b in zip(axes[i], axes[j], strict=True))
        new[j] = x, y, z
        return new[0], new[1], new[2]

    def second_moments(self, old: Sequence[Sequence[Node]]) -> list[list[Node]]:
        """R A R^T of a symmetric A; with u = s (A_ii - A_jj) + 2 c A_ij its block is [[A_ii - s u, c u - A_ij], ..].

        Half the products of two matrix products, as c^2 + s^2 = 1.
        """
        k, (i, j), (c, s) = self.axis, NEXT[self.axis], (self.cos, self.sin)
        new = [list(row) for row in old]
        if c.value == 0.0:
            new[i][i], new[j][j], new[i][j] = new[j][j], new[i][i], -new[i][j]
        else:
            u = s * (new[i][i] - new[j][j]) + 2.0 * c * new[i][j]
            new[i][i], new[j][j], new[i][j] = new[i][i] - s * u, new[j][j] + s * u, c * u - new[i][j]
        new[j][i] = new[i][j]
        a, b = new[k][i], new[k][j]
        new[k][i] = new[i][k] = c * a - s * b
        new[k][j] = new[j][k] = s * a + c * b
        return new


class MatrixTurn(NamedTuple):
    """Turn R about any axis.  rows: of R."""

    rows: Matrix
    angle: None = None  # about more than one axis
    still: bool = False

    @property
    def reversed(self) -> MatrixTurn:
        """R^T."""
        return MatrixTurn(tuple(zip(*self.rows, strict=True)))

    def into(self, vector: Triple) -> Triple:
        """R^T v: components in the turned axes."""
        return spatial.rotate_transpose(self.rows, vector)

    def out(self, vector: Triple) -> Triple:
        """R v: components in the axes before the turn."""
        return spatial.rotate(self.rows, vector)

    def columns(self, axes: Axes) -> Axes:
        """A R: the turned axes as columns, where A are those before."""
        x, y, z = (combined(axes, (as_node(a), as_node(b), as_node(c))) for a, b, c in zip(*self.rows, strict=True))
        return x, y, z

    def second_moments(self, old: Sequence[Sequence[Node]]) -> list[list[Node]]:
        """R A R^T of a symmetric A."""
        half = [self.out((row[0], row[1], row[2])) for row in old]  # columns of R A
        new = [[ZERO] * 3 for _ in range(3)]
        for i in range(3):
            for j in range(i + 1):
                new[i][j] = new[j][i] = sum([self.rows[i][k] * half[k][j] for k in range(3)], ZERO)
        return new


Turn = AxisTurn | MatrixTurn


def about_z(angle: Node) -> AxisTurn:
    """Turn about z by an angle [rad]; of 0 it turns nothing."""
    return AxisTurn(2, cg.cos(angle), cg.sin(angle), angle)


def in_a_row(first: Turn, then: Turn, way: float | Node = 1.0) -> AxisTurn:
    """Two turns about z as one.  way: 1, or -1 where the axis of the first is against that of the second."""
    assert first.angle is not None, "not about z"
    assert then.angle is not None, "not about z"
    return about_z(way * first.angle + then.angle)


NO_TURN = AxisTurn(2, as_node(1.0), ZERO, ZERO)


def constant_turns(matrix: Matrix) -> list[AxisTurn]:
    """Turns about axes that make a constant matrix from right to left, R = R_z R_x R_z."""
    rows: Array = np.array(matrix, dtype=np.float64)
    across = float(np.hypot(rows[2, 0], rows[2, 1]))
    c, s = (rows[2, 1] / across, rows[2, 0] / across) if across else (1.0, 0.0)
    rest = c * rows[:, 0] - s * rows[:, 1]  # the columns of R_z R_x: so they fit where axes are nearly parallel, too
    turns = [(2, c, s), (0, rows[2, 2], across), (2, rest[0], rest[1])]
    numbers = [(axis, float(c), float(s), math.atan2(s, c)) for axis, c, s in turns if (c, s) != (1.0, 0.0)]
    return [AxisTurn(axis, *map(as_node, row)) for axis, *row in numbers]
