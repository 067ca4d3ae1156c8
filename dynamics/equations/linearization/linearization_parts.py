"""The parts of a linearization: what the state alone decides, what every column takes once more, and a formula of both.

From tau(q, qd, qdd) = const:  M dqdd = dtau - (d tau / dx) dx, one column for each of the 2n numbers of x and the n of
tau. M is factored once; a column is then a graph of its own, small, and alike for all.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, SingularError, as_node, building, cotangents, folded, topological, with_reciprocals

from ...systems.system import System
from ..constraints.constraints import constraint_rows
from ..equation import entries
from ..mass_matrix.accelerations import BY_ENERGY, DENSE_UP_TO, accelerations
from ..mass_matrix.mass_matrix_solve import MassSolve, Rows, mass_solve, smaller_solution, units
from .inverse_dynamics_derivatives import state_slopes, torque_derivatives

Matrix = NDArray[Any]  # of numbers, (.., n, k), or of nodes, (n, k)


class LinearizationParts(NamedTuple):
    """A and B by a formula of right-hand sides W, their solutions X = M^-1 W, M^-1, and matrices of the state.

    sides: columns of W, (n + m,) with m multipliers.  rest: matrices (n, n) by name.  formula: (W, X, M^-1, *rest) to
    A, (.., 2n, 2n), and B, (.., 2n, n), of numbers or of nodes.  beside: about how many nodes the formula adds.
    """

    inputs: Sequence[Node]
    sides: Rows
    solve: MassSolve
    rest: Mapping[str, Rows]
    formula: Callable[..., tuple[Matrix, Matrix]]
    build: Builder
    beside: int = 0

    @property
    def n(self) -> int:
        """The number of velocities."""
        return len(self.solve.x)

    @property
    def size(self) -> int:
        """Number of nodes of `written_out`, about."""
        shared = topological([*self.solve.x, *entries(self.sides)])
        return len(shared) + (len(self.sides) + self.n) * len(self.solve.column) + self.beside

    def matrices(self) -> tuple[Matrix, Matrix]:
        """A and B as nodes."""
        k, inverse_sides = len(self.sides), units(self.n, len(self.solve.b))
        solved = _matrix(self.solve.solutions([*self.sides, *inverse_sides], self.build)).T
        with building(self.build):
            w, x, inverse = _matrix(self.sides).T, solved[:, :k], by_upper(solved[:, k:])
            return self.formula(w, x, inverse, *map(_matrix, self.rest.values()))

    def written_out(self) -> Graph:
        """All entries of A and B."""
        return linear_graph(self.inputs, *self.matrices())


def linear_graph(inputs: Sequence[Node], a: Matrix, b: Matrix) -> Graph:
    """All entries of A and B of nodes."""
    outputs = {f"A_{i}_{j}": as_node(entry) for (i, j), entry in np.ndenumerate(a)}
    outputs |= {f"B_{i}_{j}": as_node(entry) for (i, j), entry in np.ndenumerate(b)}
    return with_reciprocals(cg.simplify(Graph(inputs, outputs)))


def by_upper(matrix: Matrix) -> Matrix:
    """Symmetric to the last bit, by the upper triangle."""
    return np.where(np.tri(matrix.shape[-1], dtype=bool).T, matrix, np.swapaxes(matrix, -1, -2))


def _matrix(rows: Rows) -> Matrix:
    return np.array([[*row] for row in rows], dtype=object)


def velocity_form(_: Matrix, x: Matrix, inverse: Matrix, brackets: Matrix) -> tuple[Matrix, Matrix]:
    """A = [[C, 1], [X]] and B = [[0], [M^-1]] with X = -M^-1 d(tau)/dx and the brackets of xi_dot = dqd + C xi."""
    n = inverse.shape[-1]
    one, zero = np.broadcast_to(np.eye(n), inverse.shape), np.zeros(inverse.shape)
    return np.block([[brackets, one], [x[..., :n], x[..., n:]]]), np.block([[zero], [inverse]])


def linearization_parts(system: System) -> LinearizationParts:
    """Parts of the velocity form. Raises SingularMassMatrixError for a coordinate without inertia."""
    if not len(system.constraints):
        return smaller_solution(
            system,  # accelerations of the M that is factored again
            lambda method: _parts(system, accelerations(system, BY_ENERGY if method == "dense" else method), method),
            lambda parts: parts.size,
        )
    solved = accelerations(system)
    if system.n <= DENSE_UP_TO:
        with suppress(SingularError):  # which needs rows exchanged
            return _parts(system, solved, "dense")
    return _parts(system, solved, "recursive")


def _parts(system: System, solved: Graph, method: str) -> LinearizationParts:
    """Parts by one method.  solved: the accelerations, and multipliers of constraints."""
    n, build = system.n, Builder()
    nodes = dict(zip(solved.outputs, folded(list(solved.outputs.values()), build), strict=True))
    at = {qdd: nodes[f"qdd{i}"] for i, qdd in enumerate(system.qdd)}
    solve, pulls, changes = mass_solve(system, build, method), list[Node](), list[list[Node]]()
    if len(system.constraints):
        rows = constraint_rows(system, folded(system.constraints.rates, build))
        at |= {each: nodes[str(each.name)] for each in rows.multipliers}
        pulls = cotangents(dict(zip(rows.rates, rows.multipliers, strict=True)), system.qd, build)  # J^T lambda
        rates = system.constraints.rate_changes(rows.rates, build, system.qdd)
        changes = [folded(row, build, at) for row in state_slopes(system, rates, build)]  # d(dz/dt)/dx
    found = torque_derivatives(system, at, build, pulls)
    partials = [*[[*q, *qd] for q, qd in zip(found.by_q, found.by_qd, strict=True)], *changes]
    with building(build):
        # M dqdd - J^T dlambda = dtau - d(tau - J^T lambda)/dx dx,  J dqdd = -d(dz/dt)/dx dx
        sides = [[-row[j] for row in partials] for j in range(2 * n)]
    rest = {"C": system.kinematics.brackets(build)}
    return LinearizationParts(solved.inputs, sides, solve, rest, velocity_form, build)
