"""The linearization of Hamilton's equations in displacements and momenta: A = J H'' from one half of the entries.

With p = dL/du, M = dp/du, W = dp/dxi and S = d(dL/dxi)/dxi, of displacements xi, dq = G xi, at fixed u:

    du = M^-1 (dp - W xi),   X = M^-1 W,   K = W^T M^-1 W,   R = P - F_u
    A = [ C - X,                 M^-1                ]    B = [ 0 ]
        [ S - K + R X + F_q,     X^T - C^T - R M^-1  ]        [ 1 ]

F_q and F_u are the slopes of forces - damping u. C and P are of quasi-velocities alone, by their brackets c: C v =
c(u, v), P_kj = p . c(e_j, e_k). Where velocities are rates of coordinates, S is symmetric, and without forces and
damping A is J H'', H'' = [[K - S, -X^T], [-X, M^-1]], to the last bit: mirrored entries are one node.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, cotangents, folded, hessian_nodes, topological, with_reciprocals

from ...systems.system import System
from ..formulations.formulations import ONE, ZERO
from ..mass_matrix_solve import MassSolve, inverse, mass_solve, smaller_solution
from ..momentum.hamiltonian import ITERATIONS
from ..momentum.legendre import Legendre
from .inverse_dynamics_derivatives import state_slopes
from .linearization_parts import ColumnGraphs, column_graphs, mirrored

Rows = Sequence[Sequence[Node]]


class Blocks(NamedTuple):
    """M, factored, W and S."""

    solve: MassSolve
    mixed: Rows
    second: Rows

    @property
    def size(self) -> int:
        """How many nodes the factorization and its columns have, about."""
        return self.solve.size + len(self.mixed) * len(self.solve.column)


class SymmetricParts:
    """What A is made of, as nodes over (q, u): see the head of the file.

    momenta: whether P has the momenta as variables p, as of a graph over (q, p); else they are those of (q, u).
    gain: R.

    Raises SingularMassMatrixError, ConstraintError and ValueError as `hamilton_equations`.
    """

    def __init__(self, system: System, *, momenta: bool = False) -> None:
        self.system, self.transform = system, Legendre(system, Builder(), ITERATIONS)
        n, build, kinematics = system.n, self.transform.build, system.kinematics
        self.inputs = [*system.q, *system.qd, *system.extra_inputs]
        self.brackets = kinematics.brackets(build)
        terms = kinematics.structure(self.transform.p, build)
        twist = [cotangents({term: ONE}, system.qd, build) for term in terms]
        if not momenta:
            of_state = dict(zip(self.transform.p, self.transform.momenta, strict=True))
            twist = [folded(row, build, of_state) for row in twist]
        forces = state_slopes(system, folded(system.forces, build), build)
        self.by_q = [row[:n] for row in forces]
        with building(build):
            self.gain = [[a - b for a, b in zip(twist[i], forces[i][n:], strict=True)] for i in range(n)]
            for i, damping in enumerate(system.damping):
                self.gain[i][i] = self.gain[i][i] + damping

    @cached_property
    def blocks(self) -> Blocks:
        """By differentiation of L."""
        system, build, n = self.system, self.transform.build, self.system.n
        lagrangian = self.transform.lagrangian
        if system.kinematics.quasi is None:
            lower = hessian_nodes(lagrangian, [*system.q, *system.qd], build)
            mixed = [list(row[:n]) for row in lower[n:]]
            second = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
        else:
            gradient = system.kinematics.pulled_back(cotangents({lagrangian: ONE}, system.q, build), build)
            slopes = state_slopes(system, gradient, build)
            mixed, second = _transposed([row[n:] for row in slopes]), [row[:n] for row in slopes]
        return smaller_solution(system, lambda method: Blocks(mass_solve(system, build, method), mixed, second))

    @cached_property
    def derivatives(self) -> tuple[Rows, Rows, Rows]:
        """-X, M^-1 and S - K."""
        build, n = self.transform.build, self.system.n
        solve, mixed, second = self.blocks
        wt = _transposed(mixed)
        xt = solve.solutions(wt, build)
        with building(build):
            k = [[_dot(wt[i], xt[j]) for j in range(i + 1)] for i in range(n)]
            by_q = [[-xt[j][i] for j in range(n)] for i in range(n)]
            left = [[second[i][j] - k[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
        return by_q, inverse(solve, build), left

    @cached_property
    def rows(self) -> list[list[Node]]:
        """Rows of (A B), (2n, 3n)."""
        n, c, r = self.system.n, self.brackets, self.gain
        by_q, minv, second = self.derivatives
        columns = _transposed(by_q)
        with building(self.transform.build):
            top = [[c[i][j] + by_q[i][j] for j in range(n)] for i in range(n)]
            low = [[second[i][j] - _dot(r[i], columns[j]) + self.by_q[i][j] for j in range(n)] for i in range(n)]
            last = [[ZERO - top[j][i] - _dot(r[i], minv[j]) for j in range(n)] for i in range(n)]
        units = [[ONE if i == j else ZERO for j in range(n)] for i in range(n)]
        upper = [[*a, *b, *[ZERO] * n] for a, b in zip(top, minv, strict=True)]
        return [*upper, *[[*a, *b, *unit] for a, b, unit in zip(low, last, units, strict=True)]]

    @property
    def size(self) -> int:
        """How many nodes `written_out` has, about."""
        return len(topological([entry for row in self.rows for entry in row]))

    def written_out(self) -> Graph:
        """All entries of A and B over (q, u)."""
        return _graph(self.inputs, self.rows)

    def of_momenta(self) -> Graph:
        """All entries of A and B over (q, p)."""
        transform, width = self.transform, 3 * self.system.n
        of_momenta = dict(zip(self.system.qd, transform.velocities, strict=True))
        flat = folded([entry for row in self.rows for entry in row], transform.build, of_momenta)
        inputs = [*self.system.q, *transform.p, *self.system.extra_inputs]
        return _graph(inputs, [flat[k : k + width] for k in range(0, len(flat), width)])

    def in_columns(self) -> ColumnGraphs:
        """The blocks and the rest, with the columns of X and M^-1 left to a graph of one."""
        rest = {"S": self.blocks.second, "R": self.gain, "F": self.by_q, "C": self.brackets}
        return column_graphs(self.inputs, self.blocks.solve, _transposed(self.blocks.mixed), self.system.n, rest)

    def assembled(self, sides: Array, rest: Array, solutions: Array) -> tuple[Array, Array]:
        """A, (.., 2n, 2n), and B, (.., 2n, n), of columns of W and 1 and M^-1 of them, (.., n 2n), and S, R, F_q, C."""
        n, shape = self.system.n, rest.shape[:-1]
        second, gain, by_q, brackets = np.moveaxis(rest.reshape(*shape, 4, n, n), -3, 0)
        wt = np.swapaxes(sides.reshape(*shape, n, 2 * n)[..., :n], -1, -2)
        x, minv = np.split(solutions.reshape(*shape, n, 2 * n), 2, axis=-1)
        minv = mirrored(minv)
        a, b = np.empty((*shape, 2 * n, 2 * n)), np.zeros((*shape, 2 * n, n))
        with np.errstate(all="ignore"):  # of an M that is singular, which is said by who asks for a state
            a[..., :n, :n], a[..., :n, n:] = brackets - x, minv
            a[..., n:, :n] = (second - mirrored(wt @ x)) + gain @ x + by_q
            a[..., n:, n:] = np.swapaxes(x - brackets, -1, -2) - gain @ minv
        b[..., n:, :] = np.eye(n)
        return a, b


def _graph(inputs: Sequence[Node], rows: Rows) -> Graph:
    split = len(rows)
    outputs = {f"A_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[:split])}
    outputs |= {f"B_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[split:])}
    return with_reciprocals(cg.simplify(Graph(inputs, outputs)))


def _dot(row: Sequence[Node], column: Sequence[Node]) -> Node:
    total = ZERO
    for a, b in zip(row, column, strict=True):
        if a.value != 0.0:
            total = total + a * b
    return total


def _transposed(rows: Rows) -> list[list[Node]]:
    return [list(column) for column in zip(*rows, strict=True)]
