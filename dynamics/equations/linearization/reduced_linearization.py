"""Reduced linearization: A and B of the displacements that constraints admit, in independent ones of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array
from cgraph.extend import Builder

from ...systems.constraints import ConstraintError
from ...systems.model import Model, as_system
from ...systems.system import System
from ..constraints.constraint_rank import DEPENDENT, independent_rows
from ..equation import documented
from ..states.evaluate import evaluate
from ..states.initial_value import parameter_values, start_state
from .inverse_dynamics_derivatives import state_slopes
from .linearization import linearize


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
    slopes = _slopes(system, kept, dict(zip(("q", "qd"), at, strict=True)), t, parameters)
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


def _slopes(
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
    entries = [entry for row in state_slopes(system, rates, Builder()) for entry in row]
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
