"""Linearization: the exact derivative of the state equation, as a graph and at a state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, SingularError, building, cotangents, folded, solve_nodes, tangents

from ..systems.model import Model, as_system
from ..systems.system import System
from .constraints import DenseSolver, Rows, constraint_rows
from .equations_of_motion import DENSE_UP_TO, accelerations
from .evaluate_at import Array, evaluate_at
from .formulations import ONE, ZERO, torques
from .inverse_dynamics_derivatives import torque_derivatives
from .mass_matrix_solve import inverse, mass_solve
from .shorter_form import shorter_form


def state_space(model: Model) -> Graph:
    """A and B of d(xdot) = A dx + B dtau, x = (q, qd), at any state.

    Of quasi-velocities, qdot = G(q) qd, dx = (xi, dqd) has small displacements xi with dq = G xi, such as a rotation
    vector in the body's axes, so that A and B have no row or column more than there are freedoms.

    From tau(q, qd, qdd) = const: M dqdd = dtau - (d tau / dx) dx, at the qdd of forward dynamics, with the slopes of
    `inverse_dynamics_derivatives`. M is factored once for all columns: by elimination on the graph of L, which keeps
    the digits of a long chain, or as a matrix where that saves 15 % of the nodes and no path from the
    world to a tip has more than 12 coordinates.

    Rows of constraints z = J qd + a are differentiated with their multipliers, by the same elimination:
    M dqdd - J^T dlambda = dtau - d(tau - J^T lambda)/dx dx,  J dqdd = -d(dz/dt)/dx dx. At a state that meets them A
    holds for displacements that they admit, see `reduced_linearization`.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., tau0.., t if needed, parameters; outputs A_0_0, .., (2n, 2n), and B_0_0, .., (2n, n), row
        by row.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"], damping=0.5)
    >>> state = {"q0": 0.0, "qd0": 0.0, "tau0": 0.0}
    >>> {name: value for name, value in dyn.state_space(spring).evaluate(state).items() if name[2] == "1"}
    {'A_1_0': -9.0, 'A_1_1': -0.5, 'B_1_0': 1.0}
    """
    return shorter_form(as_system(model), _state_space)


def _state_space(system: System) -> Graph:
    n, build = system.n, Builder()
    solved = accelerations(system)
    columns = (_held_columns if len(system.constraints) else _free_columns)(system, solved, build)
    brackets = system.kinematics.brackets(build)  # xi_dot = dqd + C(qd) xi
    lines = [[*row, *[ONE if i == j else ZERO for j in range(n)], *[ZERO] * n] for i, row in enumerate(brackets)]
    lines += [[column[i] for column in columns] for i in range(n)]
    outputs = {f"A_{i}_{j}": entry for i, line in enumerate(lines) for j, entry in enumerate(line[: 2 * n])}
    outputs |= {f"B_{i}_{j}": entry for i, line in enumerate(lines) for j, entry in enumerate(line[2 * n :])}
    return cg.simplify(Graph(solved.inputs, outputs))


def _free_columns(system: System, solved: Graph, build: Builder) -> list[list[Node]]:
    """dqdd of the 2n numbers of x and the n of tau: M dqdd = dtau - (d tau / dx) dx; those of tau are M^-1."""
    slopes = torque_derivatives(system, folded(list(solved.outputs.values()), build), build)
    with building(build):
        sides = [[-row[j] for row in rows] for rows in (slopes.by_q, slopes.by_qd) for j in range(system.n)]
    solve = mass_solve(system, build, sides)
    return [*solve.solutions(sides, build), *inverse(solve, build)]


def _held_columns(system: System, solved: Graph, build: Builder) -> list[list[Node]]:
    """The same of a system with constraints, dqdd and -dlambda."""
    n = system.n
    lagrangian, *rates = folded([system.lagrangian, *system.constraints.rates], Builder())
    rows = constraint_rows(system, rates)
    partials = _slopes(system, rows, solved, build)
    with building(build):
        sides = [[-row[j] for row in partials] for j in range(2 * n)]
    sides += [[ONE if i == j else ZERO for i in range(len(partials))] for j in range(n)]
    if n <= DENSE_UP_TO:
        with suppress(SingularError):  # where it goes without exchanging rows
            dense = DenseSolver(system, lagrangian, rows, build)
            return [dense.solve(side) for side in sides]
    function, s = rows.function(lagrangian, build), rows.multipliers
    return [solve_nodes(function, [*system.qd, *s], side, build, multipliers=s) for side in sides]


def _slopes(system: System, rows: Rows, solved: Graph, build: Builder) -> list[list[Node]]:
    """Rows of d(tau - J^T lambda, dz/dt)/d(q, qd), (n + m, 2n), where qdd and lambda are as solved.

    Of quasi-velocities by displacements xi, dq = G xi.
    """
    tau, s = cg.simplify(torques(system)), rows.multipliers
    held = cotangents(dict(zip(rows.rates, s, strict=True)), system.qd, build)
    x_dot = dict(zip([*system.q, *system.qd], [*system.q_dot, *system.qdd], strict=True)) | {system.t: ONE}
    dots = tangents(x_dot, rows.rates, build)
    with building(build):
        equations = [torque - force for torque, force in zip(tau.outputs.values(), held, strict=True)]
    equations += [dots.get(z, ZERO) for z in rows.rates]
    entries = [entry for row in state_slopes(system, equations, build) for entry in row]
    at = {name: node for name, node in solved.outputs.items() if name in {str(each.name) for each in (*system.qdd, *s)}}
    graph = Graph([*tau.inputs, *s, *system.tau], {str(k): entry for k, entry in enumerate(entries)})
    flat = list(cg.specialize(graph, at).outputs.values())
    width = 2 * system.n
    return [flat[i : i + width] for i in range(0, len(flat), width)]


def state_slopes(system: System, nodes: Sequence[Node], build: Builder) -> list[list[Node]]:
    """Rows of d(nodes)/d(q, qd), 2n each; of quasi-velocities by displacements xi, dq = G xi."""
    split, bars = system.nq, [cotangents({node: ONE}, [*system.q, *system.qd], build) for node in nodes]
    return [[*system.kinematics.pulled_back(row[:split], build), *row[split:]] for row in bars]


def linearize(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> tuple[Array, Array]:
    """A, (2n, 2n), and B, (2n, n), of d(xdot) = A dx + B dtau, x = (q, qd), at a state and applied forces (default 0).

    Of quasi-velocities dx is of displacements, see `state_space`. With constraints the state has to meet them (see
    `consistent_state`), and `reduced_linearization` has the matrices of independent displacements.

    For many states, compile `state_space`.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.
    q, qd, tau : array_like, (n,)
        Coordinates [rad or m], their velocities, and applied forces [N m or N].
    t : float
        Time [s], for a model that depends on it.
    parameters : mapping of str to float
        Values in place of the model's.

    Returns
    -------
    A : ndarray, (2n, 2n)
    B : ndarray, (2n, n)

    Raises
    ------
    ValueError
        For arrays of another shape, a number that is not finite, or an unknown parameter.
    SingularMassMatrixError
        For a coordinate without inertia.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"], damping=0.5)
    >>> A, B = dyn.linearize(spring, [0.0], [0.0])
    >>> A.tolist(), B.tolist()
    ([[0.0, 1.0], [-9.0, -0.5]], [[0.0], [1.0]])
    """
    system = as_system(model)
    n = system.n
    flat = evaluate_at(system, state_space(system), {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if flat.ndim != 1:
        raise ValueError(f"linearize takes one state, q, qd and tau of the shape ({n},), got several rows")
    return flat[: 4 * n * n].reshape(2 * n, 2 * n), flat[4 * n * n :].reshape(2 * n, n)
