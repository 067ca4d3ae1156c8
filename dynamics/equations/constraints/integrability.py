"""Integrability: which rows of velocities are rates of functions of the coordinates, so that they hold positions.

Rows A(q) u = 0 let the system move along the kernel of A. Frobenius: they are the rates of as many functions of q (or
combinations of such) if and only if the bracket of two such motions v, w is one again, for all of them:

    B_k(v, w) = D(A_k w)[G v] - D(A_k v)[G w] + A_k c(v, w) = 0        G c(v, w) = D(G v)[G w] - D(G w)[G v]

with v and w constant in the derivatives. Of rows that are not, motions that only meet the rows (d'Alembert, what is
solved here) differ from those that make the action stationary under them (vakonomic): the rows must not enter L.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, tangents, topological

from ...systems.kinematics import ZERO
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from ..substitute import substitute
from .row_numbers import RowNumbers

STATES = 3
ROUNDING = 1e-9  # of the size of a row and its slopes


@documented
def integrable_rows(model: Model) -> dict[str, bool]:
    """Which constraints hold positions: those given as such, and rows of velocities that could be (holonomic ones).

    A row that is not integrable, such as that of rolling, holds velocities alone: all positions can still be reached.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene, with constraints that do not depend on time.

    Returns
    -------
    dict
        {name of the constraint: whether it is integrable together with the others that are}.

    Raises
    ------
    ConstraintError
        Where no state is seen that meets the constraints.
    ValueError
        For a constraint that depends on time, whose drift the brackets do not see.

    Examples
    --------
    A blade on ice moves along itself alone, and yet gets everywhere; a wheel on a rail does not.

    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + qd[2] ** 2)
    >>> def blade(q, qd, t):
    ...     return {"blade": -cg.sin(q[2]) * qd[0] + cg.cos(q[2]) * qd[1]}
    >>> dyn.integrable_rows(dyn.System(energy, "x y angle", velocity_constraints=blade))
    {'blade': False}
    >>> def rail(q, qd, t):
    ...     return {"rolling": qd[0] - 0.5 * qd[2], "rail": qd[1]}
    >>> dyn.integrable_rows(dyn.System(energy, "x y angle", velocity_constraints=rail))
    {'rolling': True, 'rail': True}
    """
    system = as_system(model)
    if not len(system.constraints):
        return {}
    for name, rate in zip(system.constraints.names, system.constraints.rates, strict=True):
        if system.t in topological([rate]):
            raise ValueError(f"integrable_rows takes constraints that do not depend on time, and {name!r} does")
    numbers, curvature = RowNumbers(system.constraints), _Curvature(system)
    kept = list(range(len(system.constraints)))
    rng = np.random.default_rng(1)
    states = list(islice(numbers.states(), STATES))
    while True:
        bent = {k for point in states for k in curvature.bent(point, numbers.matrix(point), kept, rng)}
        if not bent:
            break
        kept = [k for k in kept if k not in bent]
    return {name: k in kept for k, name in enumerate(system.constraints.names)}


class _Curvature:
    """B(v, w) of all rows as a graph over q, v and w."""

    def __init__(self, system: System) -> None:
        kinematics, rates = system.kinematics, system.constraints.rates
        n = system.n
        v, w = (cg.variables([f"{name}{i}" for i in range(n)]) for name in "vw")
        build = Builder()
        along, across = ([_at(node, system.qd, velocities) for node in rates] for velocities in (v, w))
        moving, other = kinematics.rate(v), kinematics.rate(w)
        first = tangents(dict(zip(system.q, moving, strict=True)), across, build)
        second = tangents(dict(zip(system.q, other, strict=True)), along, build)
        with building(build):
            rows = [list(row) for row in kinematics.brackets(build)]
            c = [sum([entry * x for entry, x in zip(row, w, strict=True)], ZERO) for row in rows]
        c = [_at(node, system.qd, v) for node in c]
        outputs: list[Node] = []
        with building(build):
            for rate, a, b in zip(rates, along, across, strict=True):
                turned = _at(rate, system.qd, c)
                d, e = first.get(b, ZERO), second.get(a, ZERO)
                outputs += [d - e + turned, d, e, turned]
        self.n = n
        inputs = [*system.q, system.t, *cg.variables(list(system.parameters)), *v, *w]
        self.graph = Graph(inputs, {f"{k}": node for k, node in enumerate(outputs)})

    def bent(self, point: dict[str, float], matrix: Array, rows: list[int], rng: np.random.Generator) -> set[int]:
        """Rows, of these, whose B is not 0 on two random motions that all of these allow."""
        free = _kernel(matrix[rows])
        if free.shape[1] < 2:
            return set()
        result: set[int] = set()
        for _ in range(STATES):
            v, w = (free @ rng.normal(size=free.shape[1]) for _ in range(2))
            at = point | {f"v{i}": float(x) for i, x in enumerate(v)} | {f"w{i}": float(x) for i, x in enumerate(w)}
            values = np.array(list(self.graph.evaluate(at).values()), dtype=np.float64).reshape(-1, 4)
            size = np.abs(values[:, 1:]).max(axis=1)
            result |= {k for k in rows if abs(values[k, 0]) > ROUNDING * size[k]}
        return result


def _at(node: Node, velocities: list[Node], other: list[Node]) -> Node:
    """A node with other velocities."""
    return substitute([node], dict(zip(velocities, other, strict=True)))[0]


def _kernel(matrix: Array) -> Array:
    """Columns that span the motions that the rows allow."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    size = np.abs(matrix).max(axis=1, keepdims=True)
    _, values, rows = np.linalg.svd(matrix / np.where(size > 0.0, size, 1.0))
    rank = int((values > ROUNDING * values.max(initial=0.0)).sum())
    kernel: Array = rows[rank:].T
    return kernel
