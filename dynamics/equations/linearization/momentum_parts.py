"""The linearization of Hamilton's equations in displacements and momenta: A = J H'' from one half of the entries.

With p = dL/du, M = dp/du, W = dp/dxi and S = d(dL/dxi)/dxi, of displacements xi, dq = G xi, at fixed u:

    du = M^-1 (dp - W xi),   X = M^-1 W,   K = W^T M^-1 W,   R = P - F_u
    A = [ C - X,                 M^-1                ]    B = [ 0 ]
        [ S - K + R X + F_q,     X^T - C^T - R M^-1  ]        [ 1 ]

F_q and F_u are the slopes of forces - damping u. C and P are of quasi-velocities alone, by their brackets c: C v =
c(u, v), P_kj = p . c(e_j, e_k). Where velocities are rates of coordinates, S is symmetric, and without forces and
damping A is J H'', H'' = [[K - S, -X^T], [-X, M^-1]], to the last bit: mirrored entries are one node.
"""

import numpy as np

from cgraph import Graph
from cgraph.extend import Builder, building, cotangents, folded, hessian_nodes

from ...systems.kinematics import ONE
from ...systems.system import System
from ..equation import entries, mirrored
from ..mass_matrix.mass_matrix_solve import Rows, mass_solve, smaller_solution
from ..momentum.hamiltonian import ITERATIONS
from ..momentum.legendre import Legendre
from .inverse_dynamics_derivatives import state_slopes
from .linearization_parts import LinearizationParts, Matrix, by_upper, linear_graph


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
    return _parts(Legendre(system, Builder(), ITERATIONS), momenta=False)


def of_momenta(system: System) -> Graph:
    """All entries of A and B over (q, p)."""
    transform = Legendre(system, Builder(), ITERATIONS)
    a, b = _parts(transform, momenta=True).matrices()
    velocities = dict(zip(system.qd, transform.velocities, strict=True))
    replaced = folded(entries(a.tolist()), transform.build, velocities)
    return linear_graph([*system.q, *transform.p, *system.extra_inputs], np.array(replaced).reshape(a.shape), b)


def _parts(transform: Legendre, *, momenta: bool) -> LinearizationParts:
    """momenta: whether P has the momenta as variables p, as of a graph over (q, p); else they are those of (q, u)."""
    system, build = transform.system, transform.build
    n, kinematics = system.n, system.kinematics
    twist = [cotangents({term: ONE}, system.qd, build) for term in kinematics.structure(transform.p, build)]  # P
    if not momenta:
        of_state = dict(zip(transform.p, transform.momenta, strict=True))
        twist = [folded(row, build, of_state) for row in twist]
    forces = state_slopes(system, folded(system.forces, build), build)
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
    slopes = state_slopes(system, gradient, build)
    return [row[n:] for row in slopes], [row[:n] for row in slopes]
