"""Held states: random ones that meet a system's constraints, and the equations that constraints add there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from cgraph import Graph
from cgraph._shared import Array
from cgraph.extend import Builder, cotangents

from ..equations.constraints.constraint_rank import CLEAR, least_new
from ..equations.states.consistent_state import nearest_state
from ..systems.constraints import ConstraintError
from ..systems.kinematics import ONE, changes
from ..systems.system import System
from .residual import Residual, rounded

TRIALS = 20  # for a state that constraints let be, and at which their rank is clear
DEPENDENT = 1e-9  # of the largest singular value of J, its columns scaled to kinetic energy: rows that say nothing


def random_states(system: System, count: int, t: float, speed: float, rng: np.random.Generator) -> dict[str, Array]:
    """q uniform in -pi .. pi, quaternions of length 1; qd, qdd and tau normal, of this deviation: (count, ..) each.

    Raises ConstraintError where there are constraints, and a state cannot be moved onto them.
    """
    at = {"q": _configurations(system, count, rng)}
    at |= {name: speed * rng.normal(size=(count, system.n)) for name in ("qd", "qdd", "tau")}
    if len(system.constraints):
        for k in range(count):
            at["q"][k], at["qd"][k] = _moved(system, at["q"][k], at["qd"][k], t, rng)
    return at


def _moved(system: System, q: Array, qd: Array, t: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """The state on the constraints; another one where this cannot be moved there, or where their rank is not clear.

    Newton's method is drawn to such states: those of linkages whose links lie on one another, say.
    """
    refused, doubtful = ConstraintError(), list[tuple[Array, Array]]()
    for _ in range(TRIALS):
        try:
            state = nearest_state(system, q, qd, t)
        except ConstraintError as error:
            refused = error
        else:
            if new_rows(system, state[0], t) >= CLEAR:
                return state
            doubtful.append(state)
        (q,) = _configurations(system, 1, rng)
    if not doubtful:
        raise refused
    return doubtful[0]


def new_rows(system: System, q: Array, t: float) -> float:
    """Share of the constraint nearest to a sum of the others that is new; 1 without constraints."""
    return least_new(system.constraints, q, t, system.parameters) if len(system.constraints) else 1.0


def _configurations(system: System, count: int, rng: np.random.Generator) -> Array:
    """Random coordinates, (count, nq), uniform in -pi .. pi; quaternions of length 1."""
    q = rng.uniform(-np.pi, np.pi, (count, system.nq))
    if system.kinematics.quasi is None:
        return q
    normalized = Graph(system.q, {str(i): node for i, node in enumerate(system.kinematics.normalized(system.q))})
    values = normalized.evaluate({f"q{i}": column for i, column in enumerate(q.T)}).values()
    return np.stack([np.broadcast_to(value, count) for value in values], axis=1)


class Held:
    """The rows of a system's constraints at some states.  value: numbers of a graph there, (N, n_out)."""

    def __init__(self, system: System, value: Callable[[Graph], Array]) -> None:
        self.system, self.value = system, value
        self.any = bool(len(system.constraints))

    @cached_property
    def matrix(self) -> Array:
        """J^T, (N, n, m)."""
        system, build = self.system, Builder()
        columns = [cotangents({rate: ONE}, system.qd, build) for rate in system.constraints.rates]
        outputs = {f"{i}_{k}": bar for k, column in enumerate(columns) for i, bar in enumerate(column)}
        if not outputs:
            return np.zeros((1, system.n, 0))
        values = self.value(system.graph(outputs, system.q, system.qd))
        return np.swapaxes(values.reshape(len(values), -1, system.n), 1, 2)

    def admitted(self, inertia: Array) -> Array:
        """M of the motions that the rows admit, (N, k, k); M itself, (N, n, n), without rows."""
        if not self.any:
            return inertia
        size = _sizes(inertia)
        _, values, vectors = np.linalg.svd(np.swapaxes(self.matrix / size, 1, 2))
        rank = int((values > DEPENDENT * values.max(axis=1, keepdims=True)).sum(axis=1).max())
        kernel = np.swapaxes(vectors, 1, 2)[:, :, rank:] / size
        return np.asarray(np.swapaxes(kernel, 1, 2) @ inertia @ kernel)

    def closed(self, accelerations: Array, inertia: Array, forces: Array) -> Residual:
        """The rows stay 0: their second rates, of all rows, also of those that were left out as saying nothing new.

        forces: of the constraints in absolute value, (N, n): accelerations are M^-1 of forces that in part cancel.
        """
        system = self.system
        x_dot = dict(zip(system.q, system.q_dot, strict=True)) | {system.t: ONE}
        rates = changes(x_dot, system.constraints.rates)
        graph = system.graph({str(k): rate for k, rate in enumerate(rates)}, system.q, system.qd)
        change, pushed = self.value(graph), np.swapaxes(self.matrix, 1, 2) * accelerations[:, None, :]
        size = _sizes(inertia)
        scaled = np.linalg.pinv(inertia / size / np.swapaxes(size, 1, 2), hermitian=True)  # singular without mass
        cancelled = np.abs(np.swapaxes(self.matrix / size, 1, 2)) @ np.abs(scaled) @ (forces[..., None] / size)
        terms = np.abs(change) + np.abs(pushed).sum(axis=-1) + cancelled[..., 0]
        return rounded("constraints: J qdd + (dz/dt at qdd = 0) = 0, all rows", change + pushed.sum(axis=-1), terms)


def _sizes(inertia: Array) -> Array:
    """The root of the diagonal of M, (N, n, 1), 1 where it is 0: velocities times it are scaled to kinetic energy."""
    size = np.sqrt(np.abs(np.diagonal(inertia, axis1=1, axis2=2)))
    return np.where(size > 0.0, size, 1.0)[:, :, None]
