"""The parts of a linearization: what the state alone decides, and what every column takes once more.

From tau(q, qd, qdd) = const:  M dqdd = dtau - (d tau / dx) dx, one column for each of the 2n numbers of x and the n of
tau. M is factored once; a column is then a graph of its own, small, and alike for all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, folded, topological, with_reciprocals

from ...systems.system import System
from ..accelerations import BY_ENERGY, accelerations
from ..formulations.formulations import ONE, ZERO
from ..mass_matrix_solve import MassSolve, inverse, mass_solve, smaller_solution
from .held_linearization import held_sides
from .inverse_dynamics_derivatives import torque_derivatives

Rows = Sequence[Sequence[Node]]


class ColumnGraphs(NamedTuple):
    """A linearization as two graphs.

    shared: the state to p0.., what columns read, then b_i_0, .., b_i_{k-1} for each row i, the right-hand sides of k
    columns, then the rest, such as rows of C(qd), xi_dot = dqd + C xi.  column: p0.. and a right-hand side b0.. to
    x0.., (n,).
    """

    shared: Graph
    column: Graph
    factors: int
    columns: int

    @property
    def sides(self) -> int:
        """How many entries the right-hand sides have."""
        return self.columns * (len(self.column.inputs) - self.factors)


def column_graphs(
    inputs: Sequence[Node], solve: MassSolve, sides: Rows, n: int, rest: Mapping[str, Rows]
) -> ColumnGraphs:
    """Of right-hand sides, (n + m,) with m multipliers, those of M^-1 after them, and matrices by name."""
    factors, column = solve.split()
    outputs = {f"p{k}": node for k, node in enumerate(factors)}
    for i in range(len(solve.b)):
        row = [*[side[i] for side in sides], *_unit(i, n)]
        outputs |= {f"b_{i}_{j}": entry for j, entry in enumerate(row)}
    for name, rows in rest.items():
        outputs |= {f"{name}_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    shared = with_reciprocals(cg.simplify(Graph(inputs, outputs)))
    return ColumnGraphs(shared, cg.simplify(column), len(factors), len(sides) + n)


class LinearizationParts(NamedTuple):
    """sides: right-hand sides, of displacements, then of velocities.  brackets: rows of C(qd), xi_dot = dqd + C xi."""

    inputs: Sequence[Node]
    sides: list[list[Node]]
    solve: MassSolve
    brackets: list[list[Node]]
    build: Builder

    @property
    def size(self) -> int:
        """How many nodes `written_out` has, about."""
        shared = topological([*self.solve.x, *[node for side in self.sides for node in side]])
        return len(shared) + (len(self.sides) + len(self.brackets)) * len(self.solve.column)

    def written_out(self) -> Graph:
        """All entries of A and B."""
        n = len(self.brackets)
        columns, by_tau = self.solve.solutions(self.sides, self.build), inverse(self.solve, self.build)
        rows = [[*row, *_unit(i, n), *[ZERO] * n] for i, row in enumerate(self.brackets)]
        rows += [[*[column[i] for column in columns], *by_tau[i]] for i in range(n)]
        outputs = {f"A_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[: 2 * n])}
        outputs |= {f"B_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[2 * n :])}
        return with_reciprocals(cg.simplify(Graph(self.inputs, outputs)))

    def in_columns(self) -> ColumnGraphs:
        """The same with the columns left to a graph of one."""
        return column_graphs(self.inputs, self.solve, self.sides, len(self.brackets), {"C": self.brackets})

    def assembled(self, _sides: Array, brackets: Array, solutions: Array) -> tuple[Array, Array]:
        """A, (.., 2n, 2n), and B, (.., 2n, n), of C(qd), (.., n n), and the solutions of all columns, (.., n 3n)."""
        n = len(self.brackets)
        solved = solutions.reshape(*solutions.shape[:-1], n, 3 * n).copy()
        solved[..., 2 * n :] = mirrored(solved[..., 2 * n :])  # symmetric, by the half that is written out, too
        top = np.zeros_like(solved)
        top[..., :n], top[..., n : 2 * n] = brackets.reshape(*brackets.shape[:-1], n, n), np.eye(n)
        rows = np.concatenate([top, solved], axis=-2)
        return rows[..., : 2 * n], rows[..., 2 * n :]


def linearization_parts(system: System) -> LinearizationParts:
    """Raises SingularMassMatrixError for a coordinate without inertia."""
    if not len(system.constraints):
        return smaller_solution(system, lambda method: _parts(system, method))
    solved, build = accelerations(system), Builder()
    sides, solve = held_sides(system, solved, build)
    return LinearizationParts(solved.inputs, sides, solve, system.kinematics.brackets(build), build)


def _parts(system: System, method: str) -> LinearizationParts:
    n, build = system.n, Builder()
    qdd = accelerations(system, BY_ENERGY if method == "dense" else method)  # of the M that is factored below
    slopes = torque_derivatives(system, folded(list(qdd.outputs.values()), build), build)
    with building(build):
        sides = [[-row[j] for row in rows] for rows in (slopes.by_q, slopes.by_qd) for j in range(n)]
    solve = mass_solve(system, build, method)
    return LinearizationParts(qdd.inputs, sides, solve, system.kinematics.brackets(build), build)


def mirrored(matrix: Array) -> Array:
    """Symmetric to the last bit, by the upper triangle."""
    return np.triu(matrix) + np.swapaxes(np.triu(matrix, 1), -1, -2)


def _unit(i: int, n: int) -> list[Node]:
    return [ONE if i == j else ZERO for j in range(n)]
