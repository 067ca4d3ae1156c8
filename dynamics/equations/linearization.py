"""Linearization: the exact derivative of the state equation, as a graph and at a state."""

from __future__ import annotations

from collections.abc import Mapping

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Builder, building, folded

from ..systems.model import Model, as_system
from ..systems.system import System
from .equations_of_motion import accelerations
from .evaluate_at import Array, evaluate_at
from .formulations import ONE, ZERO
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
    system.constraints.require_none("state_space")
    n, build = system.n, Builder()
    qdd = accelerations(system)
    slopes = torque_derivatives(system, folded(list(qdd.outputs.values()), build), build)
    # M dqdd = dtau - (d tau / dx) dx, one column for each of the 2n numbers of x; those of tau are M^-1.
    with building(build):
        sides = [[-row[j] for row in rows] for rows in (slopes.by_q, slopes.by_qd) for j in range(n)]
    solve = mass_solve(system, build, sides)
    columns = solve.solutions(sides, build)
    by_tau = inverse(solve, build)
    brackets = system.kinematics.brackets(build)  # xi_dot = dqd + C(qd) xi
    rows = [[*row, *[ONE if i == j else ZERO for j in range(n)], *[ZERO] * n] for i, row in enumerate(brackets)]
    rows += [[*[column[i] for column in columns], *by_tau[i]] for i in range(n)]
    outputs = {f"A_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[: 2 * n])}
    outputs |= {f"B_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row[2 * n :])}
    return cg.simplify(Graph(qdd.inputs, outputs))


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

    Of quasi-velocities dx is of displacements, see `state_space`.

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
