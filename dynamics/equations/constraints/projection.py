"""Projection: positions and velocities moved onto the constraints, by the shortest way in the mass metric.

    M dxi + J^T s = 0,   J dxi = -phi(q)        q+ = q + G dxi      (a step of Newton's method)
    M du  + J^T s = 0,   J du  = -z(q+, u)      u+ = u + du         (exact: z is linear in u)

Both are solved by the matrix of the equations of motion, see `constraints`.
"""

import warnings
from collections.abc import Mapping, Sequence

import numpy as np

import cgraph as cg
from cgraph import Graph, Node, extend
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, building, folded

from ...systems.arguments import new_variables
from ...systems.constraints import ConstraintError
from ...systems.kinematics import ZERO, numbered_graph
from ...systems.system import System
from ..substitute import substitute
from .constraint_rank import ConstraintWarning, independent_rows
from .constraints import constraint_rows
from .nearly_redundant_rows import lost_rank, opened
from .row_numbers import row_numbers

ITERATIONS = 20  # of Newton's method
SPARE = 1.5  # certain digits of a row that is not 0: a start that is off by 30 roundings is moved and said to be
NO_RATE = 1e-16  # of the rates that all velocities make
FOLLOWS = 5.5  # of one that follows from others: the rounding of axes and lengths that it has in common


@kept_by_first
def projection(system: System) -> Graph | None:
    """A state nearer to one that meets the constraints, by one step of Newton; None without constraints.

    Inputs q0.., qd0.., t if needed, parameters; outputs x0.., as many as states.
    """
    if not len(system.constraints):
        return None
    constraints, kinematics = system.constraints, system.kinematics
    written, build = Builder(), Builder()
    nodes = folded([system.lagrangian, *constraints.rates, *constraints.positions], written)
    m = len(constraints)
    lagrangian, rates, positions = nodes[0], nodes[1 : 1 + m], nodes[1 + m :]
    kept = independent_rows(constraints)
    holonomic = tuple([k for k in kept if k < len(positions)])
    q, u = system.q, system.qd

    def correction(these: tuple[int, ...], gaps: Sequence[Node]) -> list[Node]:
        """The shortest displacement that takes gaps off these rows."""
        with building(build):
            rhs = [*[ZERO] * system.n, *[-gaps[k] for k in these]]
        rows = constraint_rows(system, rates, these)
        return rows.solve(system, lagrangian, rhs, build, written=written)[: system.n]

    moved = list(q)
    if holonomic:
        shift = correction(holonomic, positions)
        with building(build):
            moved = [x + step for x, step in zip(q, kinematics.rate(shift), strict=True)]
    with building(build):
        moved = kinematics.normalized(moved)
    change = substitute(correction(kept, rates), dict(zip(q, moved, strict=True)))
    with building(build):
        velocities = [velocity + step for velocity, step in zip(u, change, strict=True)]
    return cg.simplify(system.graph({f"x{k}": x for k, x in enumerate([*moved, *velocities])}, q, u))


def projected(system: System, x: Array, t: float, parameters: Mapping[str, float]) -> Array:
    """The state x, (m,), if it meets the constraints to rounding, else one near to it that does."""
    if not len(system.constraints):
        return x
    system.constraints.given[:] = [(x[: system.nq], t, dict(parameters))]
    graph = projection(system)
    if graph is None or not (left := _open_rows(system, x, x, t, parameters)):
        return x
    others = {"t": t, **parameters}
    fixed = {name: others[name] for name in graph.input_names if name in others}
    start, names = x, graph.input_names[: len(x)]
    for k in range(2 * ITERATIONS):
        if k == ITERATIONS:  # Newton's method may need shorter steps on its way from afar
            point = row_numbers(system.constraints).closed(start[: system.nq], t, parameters).point
            x = np.array([*[point[f"q{i}"] for i in range(system.nq)], *start[system.nq :]])
        before = x
        with np.errstate(all="ignore"):
            values = graph.evaluate(dict(zip(names, x.tolist(), strict=True)) | fixed)
        x = np.array(list(values.values()), dtype=np.float64)
        if np.isfinite(x).all() and not (left := _open_rows(system, x, before, t, parameters)):
            if said := opened(system.constraints, x[: system.nq], t, parameters):
                warnings.warn(said, ConstraintWarning, stacklevel=2)
            return x
    lost = lost_rank(system.constraints, start[: system.nq], t, parameters)
    raise ConstraintError(
        f"the start cannot be moved onto the constraints: {system.constraints.names[left[0]]!r} stays open from "
        f"q = {start[: system.nq].tolist()!s:.200}{lost and f'; {lost}'}"
    )


def projected_start(system: System, x: Array, t: float, parameters: Mapping[str, float]) -> Array:
    """`projected`, with a ConstraintWarning that says how far a start was moved, and one of a rank that is lost."""
    moved = projected(system, x, t, parameters)
    if lost := lost_rank(system.constraints, moved[: system.nq], t, parameters):
        warnings.warn(f"the start: {lost}", ConstraintWarning, stacklevel=2)
    if moved is not x:
        parts = []
        for what, names, part in (
            ("coordinate", system.coordinates, slice(0, system.nq)),
            ("velocity", system.velocities, slice(system.nq, None)),
        ):
            change = np.abs(moved[part] - x[part])
            k = int(change.argmax())
            parts.append(f"{what} {names[k]!r} by {change[k]:.3g}")
        text = f"the start does not meet the constraints and was moved onto them: {' and '.join(parts)} at most"
        warnings.warn(text, ConstraintWarning, stacklevel=2)
    return moved


@kept_by_first
def _all_rows(system: System) -> Graph:
    """phi and the rates of all constraints at x + step; inputs x, t if needed, parameters, and the steps."""
    state = [*system.q, *system.qd]
    steps = new_variables("d", len(state), system.parameters)
    positions, rates = system.constraints.positions, system.constraints.rates
    with building(Builder()):
        moved = {x: x + step for x, step in zip(state, steps, strict=True)}
    rows = substitute([*positions, *rates], moved)
    return numbered_graph([*state, *system.extra_inputs, *steps], rows)


def _open_rows(system: System, x: Array, before: Array, t: float, parameters: Mapping[str, float]) -> list[int]:
    """Constraints that are not 0 at a state, or whose rate is not, beyond rounding.

    That of the step from `before`, too: what is to be 0 is so once it is small beside what it was. And a rate is 0 once
    it is small beside the rates that all velocities together make.
    """
    graph = _all_rows(system)
    others = {"t": t, **parameters}
    names, n = graph.input_names, len(x)
    point = {name: others[name] for name in names if name in others}
    point |= dict(zip([*names[:n], *names[-n:]], [*before.tolist(), *(x - before).tolist()], strict=True))
    values, digits = graph.evaluate(point), extend.certain_digits(graph, point)
    kept, left = independent_rows(system.constraints), set[int]()
    numbers = row_numbers(system.constraints)
    rows, columns = numbers.scales(numbers.point(x[: system.nq], {"t": t, **parameters}))
    fastest = float(np.abs(x[system.nq :] / columns).max(initial=0.0))
    count = len(system.constraints.positions)
    for i, (name, value) in enumerate(values.items()):
        k = i if i < count else i - count
        most = SPARE if k in kept else FOLLOWS
        small = i >= count and abs(rows[k] * value) <= NO_RATE * fastest
        if value != 0.0 and not small and not (digits[name] < most and np.isfinite(value)):
            left.add(k)
    return sorted(left)
