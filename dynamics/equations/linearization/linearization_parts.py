"""The parts of a linearization: what the state alone decides, what every column takes once more, and a formula of both.

From tau(q, qd, qdd) = const:  M dqdd = dtau - (d tau / dx) dx, one column for each of the 2n numbers of x and the n of
tau. M is factored once; a column is then a graph of its own, small, and alike for all.

Of Hamilton's equations one half of the entries is enough, A = J H''. With p = dL/du, M = dp/du, W = dp/dxi and
S = d(dL/dxi)/dxi, of displacements xi, dq = G xi, at fixed u:

    du = M^-1 (dp - W xi),   X = M^-1 W,   K = W^T M^-1 W,   R = P - F_u
    A = [ C - X,                 M^-1                ]    B = [ 0 ]
        [ S - K + R X + F_q,     X^T - C^T - R M^-1  ]        [ 1 ]

F_q and F_u are the slopes of forces - damping u. C and P are of quasi-velocities alone, by their brackets c: C v =
c(u, v), P_kj = p . c(e_j, e_k). Where velocities are rates of coordinates, S is symmetric, and without forces and
damping A is J H'', H'' = [[K - S, -X^T], [-X, M^-1]], to the last bit: mirrored entries are one node.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import (
    Builder,
    SingularError,
    as_node,
    building,
    cotangents,
    folded,
    hessian_nodes,
    topological,
    with_reciprocals,
)

from ...systems.kinematics import ONE
from ...systems.system import System
from ..constraints.constraints import constraint_rows
from ..equation import entries, mirrored
from ..mass_matrix.accelerations import (
    BY_ENERGY,
    DENSE_UP_TO,
    MassSolve,
    Rows,
    accelerations,
    mass_solve,
    smaller_solution,
    units,
)
from ..momentum.hamiltonian import ITERATIONS, Legendre
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
        changes = [folded(row, build, at) for row in state_slopes(system.kinematics, rates, build)]  # d(dz/dt)/dx
    found = torque_derivatives(system, at, build, pulls)
    partials = [*[[*q, *qd] for q, qd in zip(found.by_q, found.by_qd, strict=True)], *changes]
    with building(build):
        # M dqdd - J^T dlambda = dtau - d(tau - J^T lambda)/dx dx,  J dqdd = -d(dz/dt)/dx dx
        sides = [[-row[j] for row in partials] for j in range(2 * n)]
    rest = {"C": system.kinematics.brackets(build)}
    return LinearizationParts(solved.inputs, sides, solve, rest, velocity_form, build)


def momentum_form(
    w: Matrix, x: Matrix, inverse: Matrix, second: Matrix, gain: Matrix, by_q: Matrix, brackets: Matrix
) -> tuple[Matrix, Matrix]:
    """A and B of W, X, M^-1, S, R, F_q and C."""
    k = by_upper(np.swapaxes(np.swapaxes(w, -1, -2) @ x, -1, -2))  # K = W^T M^-1 W
    rates = brackets + -x  # du/dxi, and below the upper right block -(du/dxi)^T - R M^-1
    low = (second - k) - gain @ -x + by_q
    last = 0.0 - np.swapaxes(rates, -1, -2) - gain @ inverse
    one, zero = np.broadcast_to(np.eye(inverse.shape[-1]), inverse.shape), np.zeros(inverse.shape)
    return np.block([[rates, inverse], [low, last]]), np.block([[zero], [one]])


def momentum_parts(system: System) -> LinearizationParts:
    """Parts of the momentum form over (q, u). Raises what `hamilton_equations` raises."""
    return _momentum_parts(Legendre(system, Builder(), ITERATIONS), momenta=False)


def of_momenta(system: System) -> Graph:
    """All entries of A and B over (q, p)."""
    transform = Legendre(system, Builder(), ITERATIONS)
    a, b = _momentum_parts(transform, momenta=True).matrices()
    velocities = dict(zip(system.qd, transform.velocities, strict=True))
    replaced = folded(entries(a.tolist()), transform.build, velocities)
    return linear_graph([*system.q, *transform.p, *system.extra_inputs], np.array(replaced).reshape(a.shape), b)


def _momentum_parts(transform: Legendre, *, momenta: bool) -> LinearizationParts:
    """momenta: whether P has the momenta as variables p, as of a graph over (q, p); else they are those of (q, u)."""
    system, build = transform.system, transform.build
    n, kinematics = system.n, system.kinematics
    twist = [cotangents({term: ONE}, system.qd, build) for term in kinematics.structure(transform.p, build)]  # P
    if not momenta:
        of_state = dict(zip(transform.p, transform.momenta, strict=True))
        twist = [folded(row, build, of_state) for row in twist]
    forces = state_slopes(system.kinematics, folded(system.forces, build), build)
    with building(build):
        # R = P - F_u, where F_u has the damping D with its sign turned
        gain = [[a - b for a, b in zip(twist[i], forces[i][n:], strict=True)] for i in range(n)]
        gain = [[a + b for a, b in zip(*rows, strict=True)] for rows in zip(gain, system.damping_rows, strict=True)]
    sides, second = _slopes(transform)
    solve = smaller_solution(system, lambda method: mass_solve(system, build, method), lambda each: each.size(2 * n))
    rest = {"S": second, "R": gain, "F": [row[:n] for row in forces], "C": kinematics.brackets(build)}
    products = n * n * (n + 1) + 4 * n * sum([entry.value != 0.0 for entry in entries(gain)])
    inputs = [*system.q, *system.qd, *system.extra_inputs]
    return LinearizationParts(inputs, sides, solve, rest, momentum_form, build, products)


def _slopes(transform: Legendre) -> tuple[Rows, Rows]:
    """Columns of W, and S, by differentiation of L."""
    system, build, lagrangian = transform.system, transform.build, transform.lagrangian
    n, kinematics = system.n, system.kinematics
    if kinematics.quasi is None:
        whole = mirrored(hessian_nodes(lagrangian, [*system.q, *system.qd], build))
        return [row[n:] for row in whole[:n]], [row[:n] for row in whole[:n]]
    gradient = kinematics.pulled_back(cotangents({lagrangian: ONE}, system.q, build), build)
    slopes = state_slopes(system.kinematics, gradient, build)
    return [row[n:] for row in slopes], [row[:n] for row in slopes]
