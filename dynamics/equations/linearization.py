"""Linearization: the exact derivative of the state equation, as a graph and at a state."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Graph

from ..systems.model import Model, as_system
from ..systems.system import System
from .equations_of_motion import forward_dynamics
from .evaluate_at import Array, evaluate_at
from .initial_value import normalized
from .linearization_parts import assembled, linearization_parts
from .shorter_form import shorter_form
from .singular_mass_matrix import raise_if_singular


def state_space(model: Model) -> Graph:
    """A and B of d(xdot) = A dx + B dtau, x = (q, qd), at any state.

    Of quasi-velocities, qdot = G(q) qd, dx = (xi, dqd) has small displacements xi with dq = G xi, such as a rotation
    vector in the body's axes, so that A and B have no row or column more than there are freedoms.

    From tau(q, qd, qdd) = const: M dqdd = dtau - (d tau / dx) dx, at the qdd of forward dynamics, with the slopes of
    `inverse_dynamics_derivatives`. M is factored once for all columns: by elimination on the graph of L, which keeps
    the digits of a long chain, or as a matrix where that saves a fifth of the nodes and no path from the world to a tip
    has more than 12 coordinates.

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
    return linearization_parts(system).written_out()


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

    For many states, and for all digits of long chains, there is `linearize_many`.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.
    q, qd, tau : array_like, (nq,) and (n,)
        Coordinates [rad or m], velocities, and applied forces [N m or N].
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
        For arrays of another shape, a number that is not finite, an unknown parameter, a quaternion of length 0, or
        entries that are not finite.
    SingularMassMatrixError
        For a coordinate without inertia, or a mass matrix that is singular at this state.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"], damping=0.5)
    >>> A, B = dyn.linearize(spring, [0.0], [0.0])
    >>> A.tolist(), B.tolist()
    ([[0.0, 1.0], [-9.0, -0.5]], [[0.0], [1.0]])
    """
    system = as_system(model)
    graphs = linearization_parts(system).in_columns()
    flat = evaluate_at(system, graphs.shared, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if flat.ndim != 1:
        raise ValueError("linearize takes one state, got rows of several; see linearize_many")
    factors, sides, brackets = np.split(flat, [graphs.factors, len(flat) - system.n**2])
    rows = [*factors, *sides.reshape(-1, 3 * system.n)]
    solved = graphs.column.evaluate(dict(zip(graphs.column.input_names, rows, strict=True))).values()
    a, b = assembled(brackets, np.concatenate([np.broadcast_to(x, 3 * system.n) for x in solved]), system.n)
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        _raise_what_is_not_finite(system, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    return a, b


def _raise_what_is_not_finite(
    system: System, state: Mapping[str, ArrayLike | None], t: float, parameters: Mapping[str, float] | None
) -> None:
    """The state has a quaternion without a length, or a mass matrix that is singular, or numbers leave float64."""
    normalized(system, np.concatenate([np.asarray(state[name], dtype=np.float64) for name in ("q", "qd")]))
    info = evaluate_at(system, forward_dynamics(system, check=True), state, t, parameters)[-1]
    if np.isfinite(info):
        raise_if_singular(system, info)
    raise ValueError("there is no linearization at this state: its numbers leave the range of float64")
