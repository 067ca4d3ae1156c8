"""Integrability: which rows of velocities are rates of functions of the coordinates, so that they hold positions.

Rows A(q) u = 0 let the system move along the kernel of A. Frobenius: they are the rates of as many functions of q (or
combinations of such) if and only if the bracket of two such motions v, w is one again, for all of them:

    B_k(v, w) = D(A_k w)[G v] - D(A_k v)[G w] + A_k c(v, w) = 0        G c(v, w) = D(G v)[G w] - D(G w)[G v]

with v and w constant in the derivatives. Of rows that are not, motions that only meet the rows (d'Alembert, what is
solved here) differ from those that make the action stationary under them (vakonomic): the rows must not enter L.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import Builder, building, cotangents, tangents, topological

from ...systems.constraints import ConstraintError, Constraints
from ...systems.kinematics import ONE, ZERO
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from ..substitute import substitute
from .row_numbers import RowNumbers

if TYPE_CHECKING:
    from cgraph._shared import Json

STATES = 3
ROW_ROUNDING = 1e-9  # of the size of a row and its slopes


@documented
def integrable_rows(model: Model) -> dict[str, bool]:
    """Constraints that hold positions: those given as such, and rows of velocities that could be (holonomic ones).

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
        Where no state is seen that meets the constraints, or at which their rows and slopes are finite numbers.
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
    found = ((point, numbers.finite_matrix(point)) for point in numbers.states())
    states = list(islice(((point, matrix) for point, matrix in found if matrix is not None), STATES))
    if not states:
        raise ConstraintError("no state was seen at which the rows of the constraints are finite numbers")
    while True:
        bent = {k for point, matrix in states for k in curvature.bent(point, matrix, kept, rng)}
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
        judged = False
        for _ in range(STATES):
            v, w = (free @ rng.normal(size=free.shape[1]) for _ in range(2))
            at = point | {f"v{i}": float(x) for i, x in enumerate(v)} | {f"w{i}": float(x) for i, x in enumerate(w)}
            values = np.array(list(self.graph.evaluate(at).values()), dtype=np.float64).reshape(-1, 4)
            if not np.isfinite(values).all():
                continue
            judged, size = True, np.abs(values[:, 1:]).max(axis=1)
            result |= {k for k in rows if abs(values[k, 0]) > ROW_ROUNDING * size[k]}
        if not judged:
            raise ConstraintError("the slopes of the constraints are no finite numbers where they were looked at")
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
    rank = int((values > ROW_ROUNDING * values.max(initial=0.0)).sum())
    kernel: Array = rows[rank:].T
    return kernel


@dataclass(frozen=True)
class ConstraintLint:
    """The result of `lint_constraints`; `str` of it is the report.

    Parameters
    ----------
    integrable : mapping
        {name of a row of velocities: whether it holds a position}; None of rows that depend on time, which is not
        judged.
    vakonomic : mapping
        {coordinate that is a multiplier in L: whether its row is not integrable}, likewise.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.lint_constraints(dyn.planar_arm([1.0], [1.0])).ok
    True
    """

    integrable: Mapping[str, bool | None]
    vakonomic: Mapping[str, bool | None]

    @property
    def ok(self) -> bool:
        """Whether L has no multipliers of rows that are not integrable."""
        return not any(self.vakonomic.values())

    def __str__(self) -> str:
        """A line for each row and each multiplier."""
        rows = {
            True: "is integrable: it holds a position, and phi(q) = 0 among the constraints would keep it, too",
            False: "is not integrable (nonholonomic): it holds velocities alone. Its multiplier must not be in L, as "
            "the motion that makes that action stationary (vakonomic) is another",
            None: "depends on time, and is not judged",
        }
        multipliers = {
            True: "is a multiplier in L of a row that is not integrable: the motion is vakonomic, and not that of a "
            "body that rolls or slides; give the row as velocity_constraints",
            False: "is a multiplier in L of a row that is integrable; give the row as velocity_constraints",
            None: "is a multiplier in L of a row that depends on time, which is not judged",
        }
        lines = [f"velocity constraint {name!r} {rows[said]}" for name, said in self.integrable.items()]
        return "\n".join(lines + [f"coordinate {name!r} {multipliers[said]}" for name, said in self.vakonomic.items()])

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"ok": self.ok, "integrable": dict(self.integrable), "vakonomic": dict(self.vakonomic)}


@documented
def lint_constraints(model: Model) -> ConstraintLint:
    """Say of every row of velocities whether it is integrable, and whether L has a multiplier of one that is not.

    Of rows that are not rates of positions, as those of rolling, bodies move by d'Alembert's principle: the rows hold
    the motion by J^T lambda, as `System(velocity_constraints=)` has it. With multipliers in L, L + mu . (A qd), the
    action is stationary among the motions that meet the rows, which is another motion (vakonomic). A coordinate
    without a velocity in L is such a multiplier if the slope of L along it is linear in velocities.

    Returns
    -------
    ConstraintLint

    Raises
    ------
    ConstraintError
        Where no state is seen that meets the constraints.

    Examples
    --------
    A blade on ice, once as it is, and once with its multiplier in L:

    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> def blade(q, qd, t):
    ...     return {"blade": cg.cos(q[2]) * qd[1] - cg.sin(q[2]) * qd[0]}
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + 0.3 * qd[2] ** 2)
    >>> dyn.lint_constraints(dyn.System(energy, "x y angle", velocity_constraints=blade)).integrable
    {'blade': False}
    >>> def action(q, qd, t):
    ...     return energy(q, qd, t) + q[3] * blade(q, qd, t)["blade"]
    >>> dyn.lint_constraints(dyn.System(action, "x y angle mu")).vakonomic
    {'mu': True}
    """
    system = as_system(model)
    alone = _judged(system)
    names = system.constraints.names[len(system.constraints.positions) :]
    rows = _multiplied(system)
    among = _judged(_with_rows(system, rows)) if rows else {}
    return ConstraintLint(
        {name: alone[name] for name in names},
        {name: None if among[name] is None else not among[name] for name in rows},
    )


def _judged(system: System) -> dict[str, bool | None]:
    """`integrable_rows`; of rows that do not depend on time, if others do."""
    constraints = system.constraints
    timed = {name for name, z in zip(constraints.names, constraints.rates, strict=True) if system.t in topological([z])}
    if not timed:
        return dict(integrable_rows(system))
    count = len(constraints.positions)
    kept = [name for name in constraints.names[count:] if name not in timed]
    rows = dict(zip(constraints.names[count:], constraints.velocities, strict=True))
    judged = integrable_rows(_with_rows(system, {name: rows[name] for name in kept}))
    return {name: judged.get(name) for name in constraints.names}


def _with_rows(system: System, rows: Mapping[str, Node]) -> System:
    """The system constrained by these rows of velocities alone."""
    given = (system.kinematics, system.t, system.parameters, None, lambda q, u, t, p: dict(rows))
    return system.changed(constraints=Constraints(*given), extra_inputs=system.extra_inputs)


def _multiplied(system: System) -> dict[str, Node]:
    """{coordinate without velocity in L: slope of L along it, where that is linear in the velocities}."""
    if system.kinematics.quasi is not None:
        return {}
    build = Builder()
    slopes = cotangents({system.lagrangian: ONE}, system.q, build)
    reached = set(topological([system.lagrangian]))
    rows = {}
    for name, q, u, slope in zip(system.coordinates, system.q, system.qd, slopes, strict=True):
        below = set(topological([slope]))
        if u in reached or q in below or not below & set(system.qd):
            continue
        curved = topological(cotangents({slope: ONE}, system.qd, build))
        if not set(curved) & set(system.qd):
            rows[name] = slope
    return rows
