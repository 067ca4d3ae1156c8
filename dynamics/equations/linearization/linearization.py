"""Linearization: the exact derivative of the state equation or of Hamilton's, as a graph, at a state and at many.

Of a constrained system also in displacements that the constraints admit, independent of one another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, kept_by_first, require_choice, solve_tangents
from cgraph.extend import Builder, building, cotangents, folded, tangents, topological

from ...systems.constraints import ConstraintError
from ...systems.kinematics import ONE, ZERO, dot, numbered_graph
from ...systems.model import Model, as_system
from ...systems.system import System
from ..bias_terms import bias_terms
from ..constraints.constraint_rank import DEPENDENT, independent_rows
from ..equation import Equation, Output, documented, shortened
from ..equations_of_motion import forward_dynamics
from ..mass_matrix.accelerations import longest_path
from ..mass_matrix.singular_mass_matrix import raise_if_singular
from ..state_equation import FORMS
from ..states.evaluate import evaluate, input_rows
from ..states.initial_value import normalized, parameter_values, start_state
from .inverse_dynamics_derivatives import state_slopes
from .linearization_parts import by_upper, linearization_parts, momentum_parts, of_momenta

# Nodes; beyond, slopes along directions are made in a fraction of the time, and soon are as fast.
WRITTEN_OUT = 20_000
FORWARD_SHARE = 3  # of the nodes of all entries, at most one in so many is forward dynamics
# Coordinates from the world to a tip. Beyond, forces of inertia add up to so much more than is left of them that
# rounding is more than 2e-14 of the largest entry, and forward dynamics itself is differentiated.
LONG_PATH = 32
_slopes = kept_by_first(cg.jvp)
_machine_code = kept_by_first(cg.compile)


@Equation("q qd tau", Output("A_{}_{}", ("2n", "2n")), Output("B_{}_{}", ("2n", "n"))).describes
def state_space(model: Model, *, form: str = "velocity") -> Graph:
    """A and B of d(xdot) = A dx + B dtau, x = (q, qd), or x = (q, p) of the momentum form, at any state.

    Of quasi-velocities, qdot = G(q) qd, dx = (xi, dqd) has small displacements xi with dq = G xi, such as a rotation
    vector in the body's axes, so that A and B have no row or column more than there are freedoms.

    From tau(q, qd, qdd) = const: M dqdd = dtau - (d tau / dx) dx, at the qdd of forward dynamics, with the slopes of
    `inverse_dynamics_derivatives`. M is factored once for all columns: by elimination on the graph of L, which keeps
    the digits of a long chain, or as a matrix where that saves a fifth of the nodes and no path from the world to a tip
    has more than 12 coordinates.

    Rows of constraints z = J qd + a are differentiated with their multipliers, by the same elimination:
    M dqdd - J^T dlambda = dtau - d(tau - J^T lambda)/dx dx,  J dqdd = -d(dz/dt)/dx dx. At a state that meets them A
    holds for displacements that they admit, see `reduced_linearization`.

    In coordinates and momenta p = dL/dqd, of Hamilton's equations, one half of the entries is enough: without damping
    and forces A = J H'', with J = [[0, 1], [-1, 0]] and the symmetric second slopes of H(q, p), so that J A is
    symmetric to the last bit, and B = [0, 1]. Damping D and forces f(q, qd, t) add df - D dqd to the rates of momenta,
    dqd = H_pq dq + H_pp dp, which is not symmetric. A does not depend on tau. With W = dp/dq at fixed velocities,
    H'' is

        H_pp = M^-1,   H_pq = -M^-1 W,   H_qq = W^T M^-1 W - d2L/dq2

    Of quasi-velocities dp is the change of the numbers p, and A is that of (xi, dp). In (xi, dp + P xi / 2), with
    P_kj = p . c(e_j, e_k) of the brackets c, it is J times a symmetric matrix again.

    Returns
    -------
    Of the momentum form the inputs are q0.., p0.., without tau0... The velocities of p are those of
    `hamilton_equations`, with its error where L is not quadratic in them.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    ConstraintError
        For the momentum form of a model with constraints.
    ValueError
        For the momentum form of a model with a parameter that is called like a momentum.

    Examples
    --------
    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"], damping=0.5)
    >>> state = {"q0": 0.0, "qd0": 0.0, "tau0": 0.0}
    >>> {name: value for name, value in dyn.state_space(spring).evaluate(state).items() if name[2] == "1"}
    {'A_1_0': -9.0, 'A_1_1': -0.5, 'B_1_0': 1.0}
    >>> pendulum = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2 + 20.0 * cg.cos(q[0]), ["angle"])
    >>> dyn.state_space(pendulum, form="momentum").evaluate({"q0": 0.0, "p0": 0.0})
    {'A_0_0': 0.0, 'A_0_1': 0.25, 'A_1_0': -20.0, 'A_1_1': 0.0, 'B_0_0': 0.0, 'B_1_0': 1.0}
    """
    if require_choice("form", form, FORMS) == "velocity":
        return shortened(as_system(model), lambda system: linearization_parts(system).written_out())
    return shortened(as_system(model), of_momenta, mirrored=True)


class LinearRows(NamedTuple):
    """Rows of (A B), (2n, 3n), as a graph, below those that are the same at every state, (0 1 0).

    graph: their entries row by row, or the rates that have them as slopes by `wrt`.  inputs: names of those that a
    state gives; behind them are displacements, which are 0.  wrt: displacements, velocities and forces, or none.
    turned: whether the graph has sums of rows instead, whose slopes by weights, behind the inputs, are the columns.
    """

    graph: Graph
    inputs: Sequence[str]
    wrt: tuple[Node, ...]
    above: Array
    turned: bool = False


def linear_rows(system: System, form: str) -> LinearRows:
    """All entries, or of a large system sums of rows, or the rates that `forward_dynamics` gives."""
    return _linear_rows(system, form, (tuple(system.forces), tuple(system.damping)))


@kept_by_first
def _linear_rows(system: System, form: str, _: tuple[object, ...]) -> LinearRows:
    """The last: forces and damping of the system, which may be given anew."""
    n, velocity = system.n, form == "velocity"
    if velocity:
        equations = forward_dynamics(system)
        large = len(equations.nodes) >= WRITTEN_OUT // FORWARD_SHARE
        if large or (parts := linearization_parts(system)).size >= WRITTEN_OUT:
            held = len(system.constraints) or longest_path(system.lagrangian, system.qd) > LONG_PATH
            return _displaced_rates(system, equations) if held else _summed_rows(system, equations)
    else:
        parts = momentum_parts(system)
    graph = parts.written_out()
    above = np.eye(n if velocity and system.kinematics.quasi is None else 0, 3 * n, n)
    below = range(len(above), 2 * n)
    names = [[*[f"A_{i}_{j}" for j in range(2 * n)], *[f"B_{i}_{j}" for j in range(n)]] for i in below]
    rows = numbered_graph(graph.inputs, [graph.outputs[name] for row in names for name in row])
    return LinearRows(rows, graph.input_names, (), above)


def _summed_rows(system: System, equations: Graph) -> LinearRows:
    """Sums of rows.  equations: forward dynamics."""
    weights = tuple(cg.variables([f"row:{i}" for i in range(2 * system.n)]))
    graph = numbered_graph([*equations.inputs, *weights], row_sums(system, equations, weights))
    return LinearRows(graph, equations.input_names, weights, np.empty((0, 3 * system.n)), turned=True)


def _displaced_rates(system: System, equations: Graph) -> LinearRows:
    """The rates (xi_dot, qdd) at a state moved by displacements xi from 0, which where velocities are rates are q."""
    kinematics, n = system.kinematics, system.n
    inputs, xi, rates = equations.inputs, system.q, system.qd
    nodes, none = list(equations.outputs.values())[:n], np.empty((0, 3 * n))  # without multipliers
    if kinematics.quasi is not None:
        xi, build = cg.variables([f"xi:{i}" for i in range(n)]), Builder()
        moves, brackets = folded(kinematics.rate(xi), build), kinematics.brackets(build)
        with building(build):
            at = {q: q + move for q, move in zip(system.q, moves, strict=True)}
            turned = [sum([c * x for c, x in zip(row, xi, strict=True)], ZERO) for row in brackets]
            rates = [u + turn for u, turn in zip(rates, turned, strict=True)]  # xi_dot = dqd + C xi
        inputs, nodes = (*inputs, *xi), folded(nodes, build, at)
    graph = numbered_graph(inputs, [*rates, *nodes])
    return LinearRows(graph, equations.input_names, (*xi, *system.qd, *system.tau), none)


def matrices(rows: Array, found: LinearRows) -> tuple[Array, Array]:
    """A and B of rows of (A B), (.., 2n, 3n), of which those below are there."""
    n = rows.shape[-1] // 3
    rows[..., : len(found.above), :] = found.above
    if found.wrt:  # B is M^-1: of its entries the upper triangle counts
        rows[..., n:, 2 * n :] = by_upper(rows[..., n:, 2 * n :])
    return rows[..., : 2 * n], rows[..., 2 * n :]


@documented
def linearize(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    form: str = "velocity",
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> tuple[Array, Array]:
    """A, (2n, 2n), and B, (2n, n), of d(xdot) = A dx + B dtau, x = (q, qd), at a state and applied forces (default 0).

    Of the momentum form x = (q, p), see `state_space`; the state is q and qd all the same, so that nothing is iterated.
    Of quasi-velocities dx is of displacements, see there, too. With constraints the state has to meet them (see
    `consistent_state`), and `reduced_linearization` has the matrices of independent displacements.

    For many states there is `linearize_many`.

    Parameters
    ----------
    q, qd, tau : array_like, (nq,) and (n,)
        Coordinates [rad or m], velocities, and applied forces [N m or N].

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
    ConstraintError
        For the momentum form of a model with constraints.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * 9.0 * q[0] ** 2, ["x"], damping=0.5)
    >>> A, B = dyn.linearize(spring, [0.0], [0.0])
    >>> A.tolist(), B.tolist()
    ([[0.0, 1.0], [-9.0, -0.5]], [[0.0], [1.0]])

    In the momentum form A is J H'', and its modes are those of the motion:

    >>> pendulum = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> A, B = dyn.linearize(pendulum, [0.0, 0.0], [0.0, 0.0], form="momentum")
    >>> (A.round(3) + 0.0).tolist()
    [[0.0, 0.0, 1.714, -4.286], [0.0, 0.0, -4.286, 13.714], [-19.62, -4.905, 0.0, 0.0], [-4.905, -4.905, 0.0, 0.0]]
    """
    system, state = as_system(model), {"q": q, "qd": qd, "tau": tau}
    by_rows = None if system.body_terms is None else system.body_terms.linearized
    if require_choice("form", form, FORMS) == FORMS[0] and by_rows is not None:
        return by_rows(q, qd, 0.0 if tau is None else tau)
    found, size = linear_rows(system, form), 3 * system.n
    x = input_rows(system, found.inputs, state, t, parameters)
    if x.ndim != 1:
        raise ValueError("linearize takes one state, got rows of several; see linearize_many")
    rows, graph, values = np.empty((2 * system.n, size)), found.graph, x.tolist()
    if found.turned:  # by all weights at once
        values += [*np.eye(len(found.wrt))]
    elif found.wrt:  # along all directions at once
        graph = _slopes(found.graph, found.wrt)
        values += [*[0.0] * (len(found.graph.inputs) - len(values)), *np.eye(size)]
    entries = graph.evaluate(dict(zip(graph.input_names, values, strict=True))).values()
    if found.wrt:
        (rows.T if found.turned else rows)[:] = [np.broadcast_to(each, len(found.wrt)) for each in entries]
    else:
        rows[len(found.above) :] = np.reshape([*entries], (-1, size))
    a, b = matrices(rows, found)
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        _raise_what_is_not_finite(system, state, t, parameters)
    return a, b


@documented
def linearize_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    form: str = "velocity",
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    threads: int | None = 1,
) -> tuple[Array, Array]:
    """`linearize` at N states, such as those of a horizon: machine code, made at the first call and kept.

    Of small systems, and of the momentum form, whose states are q and qd, too, it is `state_space`, all entries written
    out. Of larger ones it is a colored Jacobian: of sums of rows by weights, or, with constraints or where a path from
    the world to a tip has more than 32 coordinates, of `forward_dynamics` by displacements, velocities and forces; it
    keeps the digits of long chains, too, whatever the condition of M. States lie side by side in vectors.
    The matrices of a state whose mass matrix is singular, or with a quaternion of length 0, have entries that are
    infinite or NaN.

    Parameters
    ----------
    q, qd, tau : array_like, (N, nq) and (N, n)
        Coordinates [rad or m], their velocities, and applied forces [N m or N]; one row is the same for all.
    threads : int, optional
        How many share the states; None: one for each core.

    Returns
    -------
    A : ndarray, (N, 2n, 2n)
    B : ndarray, (N, 2n, n)

    Raises
    ------
    ValueError, SingularMassMatrixError
        As for `linearize`; for arrays that are all of one state; for a number of threads below 1.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0], gravity=10.0)
    >>> A, B = dyn.linearize_many(arm, [[0.0], [3.141592653589793]], [[0.0], [0.0]])
    >>> A[:, 1, 0].round(12).tolist(), B.shape
    ([-15.0, 15.0], (2, 2, 1))
    """
    system = as_system(model)
    found, n = linear_rows(system, require_choice("form", form, FORMS)), system.n
    function = _machine_code(found.graph)
    values = input_rows(system, found.inputs, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if values.ndim != 2:
        raise ValueError("linearize_many takes rows of states, got one state; see linearize")
    if found.wrt:
        x = np.hstack([values, np.zeros((len(values), function.n_in - len(found.inputs)))])
        x = x[0] if len(x) == 1 else x  # of one the columns fill vectors, not the states
        rows = function.jacobian(x, wrt=found.wrt, threads=threads).reshape(-1, function.n_out, len(found.wrt))
        rows = rows.swapaxes(1, 2) if found.turned else rows
    else:
        rows = np.empty((len(values), 2 * n, 3 * n))
        function.batch(values.T, threads, out=rows.reshape(-1, 6 * n * n)[:, found.above.size :].T)
    return matrices(rows, found)


def _raise_what_is_not_finite(
    system: System, state: Mapping[str, ArrayLike | None], t: float, parameters: Mapping[str, float] | None
) -> None:
    """The state has a quaternion without a length, or a mass matrix that is singular, or numbers leave float64."""
    normalized(system, np.concatenate([np.asarray(state[name], dtype=np.float64) for name in ("q", "qd")]))
    info = evaluate(system, forward_dynamics(system, check=True), state, t, parameters)[-1]
    if np.isfinite(info):
        raise_if_singular(system, info)
    raise ValueError("there is no linearization at this state: its numbers leave the range of float64")


def row_sums(system: System, equations: Graph, weights: Sequence[Node]) -> list[Node]:
    """Sums of d(xi_dot, qdd)/d(xi, qd, tau), 3n, without constraints: their slopes by the weights are (A B)^T.

    With weights r of qdd, and torques of inverse dynamics:

        w = M^-1 r = r . dqdd/dtau,   r . dqdd/dx = -d(w . torque)/dx at fixed w and qdd

    The elimination that gives w gives the tangents of all velocity nodes along it, too, and the sweep takes these: sums
    of w along a chain would lose digits that elimination keeps.

    equations: forward dynamics.  weights: of the 2n rows.
    """
    n, kinematics, build = system.n, system.kinematics, Builder()
    rates = folded(list(equations.outputs.values()), build)
    by_q, by_qd, by_tau = _acceleration_sums(system, rates, weights[n:], build)
    by_xi, columns = kinematics.pulled_back(by_q, build), zip(*kinematics.brackets(build), strict=True)
    with building(build):  # xi_dot = dqd + C xi
        by_xi = [bar + dot(column, weights[:n]) for bar, column in zip(by_xi, columns, strict=True)]
        return [*by_xi, *[bar + weight for bar, weight in zip(by_qd, weights[:n], strict=True)], *by_tau]


def _acceleration_sums(
    system: System, rates: Sequence[Node], weights: Sequence[Node], build: Builder
) -> tuple[list[Node], list[Node], list[Node]]:
    """Sums of dqdd/dq, dqdd/dqd and dqdd/dtau.  rates: the accelerations."""
    n, system = system.n, system.whole or system  # of numbers that keep most digits
    terms, braking = bias_terms(system, system.qdd), system.braking(build)
    given = (*terms.inertial, *terms.inertial.values(), *terms.gradient, *terms.forces)
    lagrangian, *nodes = folded([terms.lagrangian, *given], build)
    k, gradient, applied = len(terms.inertial), nodes[-2 * n : -n], nodes[-n:]
    solved, w = solve_tangents(lagrangian, system.qd, weights, build), cg.variables([f"w{i}#" for i in range(n)])
    along = tangents(dict(zip(system.qd, w, strict=True)), topological(nodes[:k]), build)
    with building(build):
        at_rest = [slope - brake + force for slope, brake, force in zip(gradient, braking, applied, strict=True)]
        power = dot([along.get(z, ZERO) for z in nodes[:k]], nodes[k : 2 * k]) - dot(w, at_rest)  # w . torque
        bars = cotangents({power: -ONE}, [*system.q, *system.qd], build)
    known = {along[node]: solved[node] for node in along if node in solved}
    slopes = folded(bars, build, known | dict(zip(system.qdd, rates, strict=True)))
    return slopes[: system.nq], slopes[system.nq :], [solved[u] for u in system.qd]


class ReducedLinearization(NamedTuple):
    """The linear motion of a constrained system in displacements that are independent of one another.

    Parameters
    ----------
    A : ndarray, (k, k)
    B : ndarray, (k, n)
        d(ydot) = A dy + B dtau.
    states : tuple of str
        What dy are, k names: "q.<velocity>" a displacement along this velocity, which is that of the coordinate unless
        there are quasi-velocities; "qd.<velocity>" a change of it.
    displacements : ndarray, (2n, k)
        N of dx = N dy, x = (q, qd): all displacements that the constraints admit.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 4.5 * q[0] ** 2, ["x"])
    >>> dyn.reduced_linearization(spring, [0.0], [0.0]).states
    ('q.x', 'qd.x')
    """

    A: Array
    B: Array
    states: tuple[str, ...]
    displacements: Array


@documented
def reduced_linearization(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> ReducedLinearization:
    """`linearize` of a system with constraints, in as many displacements as it has freedoms.

    Rows phi(q) = 0 and z(q, qd) = J qd + a = 0 admit the displacements dx = (xi, dqd) with

        J_phi xi = 0,   (dz/dq) xi + J dqd = 0

    Those dy of dx that the rest follow from, dx = N dy, are chosen at the state, by elimination. They are entries of
    dx, and so d(ydot) = (A N) dy, these rows of it, is exact, also where the motion is none of rest. Nonholonomic rows
    hold velocities alone: there are more displacements than velocities.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n velocities; without constraints N is 1.
    q, qd : array_like, (nq,) and (n,)
        Coordinates [rad or m] and velocities. A state that does not meet the constraints is moved onto them, with a
        ConstraintWarning.

    Returns
    -------
    ReducedLinearization
        A, B, the names of the states, and N.

    Raises
    ------
    ConstraintError
        Where a constraint says nothing new at this state, so that its motions have no linear form.
    ValueError
        For arrays of another shape, a number that is not finite, or an unknown parameter.

    Examples
    --------
    A mass on a rod of 2 m, in x and y, hangs at rest and swings with the square of the frequency 9.81 / 2:

    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1]
    >>> rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 4.0})
    >>> small = dyn.reduced_linearization(rod, [0.0, -2.0], [0.0, 0.0])
    >>> small.A.round(12).tolist(), small.states
    ([[0.0, 1.0], [-4.905, 0.0]], ('q.x', 'qd.x'))
    """
    system = as_system(model)
    x = start_state(system, q, qd, parameter_values(system, parameters), t)
    n, at = system.n, (x[: system.nq], x[system.nq :])
    kept = independent_rows(system.constraints)
    slopes = _row_slopes(system, kept, dict(zip(("q", "qd"), at, strict=True)), t, parameters)
    holonomic = sum(k < len(system.constraints.positions) for k in kept)
    following = _following(system, kept, slopes[:, n:])
    a, b = linearize(model, *at, tau, t=t, parameters=parameters)
    # J_phi xi = 0, then (dz/dq) xi + J dqd = 0
    rows = np.vstack([np.hstack([slopes[:holonomic, n:], np.zeros((holonomic, n))]), slopes])
    rows = rows / np.abs(rows).max(axis=1, keepdims=True, initial=0.0)
    rest = [*following[:holonomic], *[n + j for j in following]]
    chosen = [j for j in range(2 * n) if j not in rest]
    # dx = N dy: entries that are chosen are dy, the rest follow from them
    displacements = np.eye(2 * n)[:, chosen]
    displacements[rest] = -np.linalg.solve(rows[:, rest], rows[:, chosen])
    names = [f"{kind}.{name}" for kind in ("q", "qd") for name in system.velocities]
    states = tuple([names[j] for j in chosen])
    return ReducedLinearization((a @ displacements)[chosen], b[chosen], states, displacements)


def _row_slopes(
    system: System,
    kept: tuple[int, ...],
    state: Mapping[str, ArrayLike],
    t: float,
    parameters: Mapping[str, float] | None,
) -> Array:
    """dz/dx of these rows at a state, (m, 2n)."""
    rates = [system.constraints.rates[k] for k in kept]
    if not rates:
        return np.zeros((0, 2 * system.n))
    entries = [entry for row in state_slopes(system.kinematics, rates, Builder()) for entry in row]
    graph = system.graph({str(k): entry for k, entry in enumerate(entries)}, system.q, system.qd)
    return evaluate(system, graph, state, t, parameters).reshape(len(rates), -1)


def _following(system: System, kept: tuple[int, ...], matrix: Array) -> list[int]:
    """Velocities that follow from the others, one for each row in turn, by the largest entry of J, (m, n)."""
    left, chosen = matrix, list[int]()
    for axis in (0, 1) * 4:  # entries are made alike, and free of units (Ruiz)
        size = np.abs(left).max(axis=axis, keepdims=True, initial=0.0)
        left = left / np.sqrt(np.where(size > 0.0, size, 1.0))
    for k, row in enumerate(left):
        pivot = int(np.abs(row).argmax())
        if not np.abs(row[pivot]) > DEPENDENT:
            name = system.constraints.names[kept[k]]
            raise ConstraintError(f"at this state constraint {name!r} says nothing that the others do not say")
        chosen.append(pivot)
        left[k + 1 :] -= np.outer(left[k + 1 :, pivot] / row[pivot], row)
        left[k + 1 :, pivot] = 0.0
    return chosen
