"""Constraints in the equations of motion: multipliers as further unknowns of the same elimination.

Rows of velocities z(q, u, t) = 0 hold the motion by forces J^T lambda, J = dz/du. The scalar F(q, u, s) = L + s . z
has, in w = (u, s), the Hessian [[M, J^T], [J, 0]], so that

    M udot - J^T lambda = tau + forces - damping * u - bias
    J udot = -(dz/dt at udot = 0)

is one `solve_nodes` of F, with lambda = -s. F serves for its Hessian alone: of rows that no function of positions has
as its rate, the motion is not the stationary one of L + s . z, and nothing else is derived from it.

Positions and velocities are moved onto the constraints by the same matrix, by the shortest way in the mass metric:

    M dxi + J^T s = 0,   J dxi = -phi(q)        q+ = q + G dxi      (a step of Newton's method)
    M du  + J^T s = 0,   J du  = -z(q+, u)      u+ = u + du         (exact: z is linear in u)
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node, extend
from cgraph._shared import Array, Order, kept_by_first, ldl_solve
from cgraph.extend import Builder, building, cotangents, folded, hessian_nodes, solve_nodes, topological

from ...systems.arguments import new_variables
from ...systems.constraints import ConstraintError
from ...systems.kinematics import ONE, ZERO, numbered_graph, substitute
from ...systems.system import System
from .constraint_rank import ConstraintWarning, independent_rows, lost_rank, opened
from .row_numbers import row_numbers


class Rows(NamedTuple):
    """The independent rows z of a system's constraints, and the multipliers in F = L + s . z."""

    kept: tuple[int, ...]  # of all rows
    rates: list[Node]  # z
    multipliers: list[Node]  # s

    def solve(
        self,
        system: System,
        lagrangian: Node,
        rhs: Sequence[Node],
        build: Builder,
        *,
        written: Builder | None = None,
        at: dict[Node, Node] | None = None,
        check: bool = False,
        order: Order = "recursive",
    ) -> list[Node]:
        """(udot, s) and with `check` the info, by elimination on the graph of F.

        written: the builder of L and z, if it is another.
        """
        with building(written or build):  # F = L + s . z
            for weight, z in zip(self.multipliers, self.rates, strict=True):
                lagrangian = lagrangian + weight * z
        s = self.multipliers
        return solve_nodes(lagrangian, [*system.qd, *s], rhs, build, at=at, multipliers=s, check=check, order=order)

    def solve_densely(
        self,
        system: System,
        lagrangian: Node,
        rhs: Sequence[Node],
        build: Builder,
        *,
        composites: bool = False,
        check: bool = False,
    ) -> list[Node]:
        """(udot, s) by LDL^T of the whole matrix, multipliers eliminated last; the info only where there are no rows.

        composites: take M as bodies give it, `System.mass_matrix`, which has fewer nodes than the Hessian of L; its
        entries are rounded as wholes, and a factorization may lose the more digits, the worse M is.
        """
        slopes, m = [cotangents({z: ONE}, system.qd, build) for z in self.rates], len(self.rates)
        whole = system.mass_matrix(lagrangian, build) if composites else hessian_nodes(lagrangian, system.qd, build)
        # [[0, J], [J^T, M]], the lower triangle
        matrix = [[ZERO] * (k + 1) for k in range(m)]
        matrix += [[*[slope[i] for slope in slopes], *row[: i + 1]] for i, row in enumerate(whole)]
        solved = ldl_solve(matrix, [*rhs[system.n :], *rhs[: system.n]], build, check=check and not m)
        return [*solved[m:], *solved[:m]]


def constraint_rows(system: System, rates: Sequence[Node], kept: tuple[int, ...] | None = None) -> Rows:
    """The rows that a system is solved with, of all as they are folded; none of a system without constraints.

    kept: some of all rows, in place of the independent ones.
    Raises ConstraintError for constraints that cannot be met together.
    """
    kept = independent_rows(system.constraints) if kept is None else kept
    return Rows(kept, [rates[k] for k in kept], cg.variables([f"lambda{k}" for k in kept]))


def leave_no_motion(system: System) -> bool:
    """Whether constraints do not depend on time and admit no motion: as many independent ones as velocities."""
    rates = system.constraints.rates
    return len(rates) >= system.n == len(independent_rows(system.constraints)) and system.t not in topological(rates)


def unknown_names(system: System) -> list[str]:
    """Unknowns of `solve_nodes` in words: velocities, then independent constraints."""
    names = [f"constraint {system.constraints.names[k]!r}" for k in independent_rows(system.constraints)]
    return [*[f"coordinate {name!r}" for name in system.velocities], *names]


def multiplier_outputs(system: System, rows: Rows, solved: Sequence[Node], build: Builder) -> dict[str, Node]:
    """lambda0.. of all rows from s of the independent ones; 0 of those that follow from others."""
    with building(build):
        values = {k: -s for k, s in zip(rows.kept, solved, strict=True)}
    return {f"lambda{k}": values.get(k, ZERO) for k in range(len(system.constraints))}


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
