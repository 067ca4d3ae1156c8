"""Constraints in the equations of motion: multipliers as further unknowns of the same elimination.

Rows of velocities z(q, u, t) = 0 hold the motion by forces J^T lambda, J = dz/du. The scalar F(q, u, s) = L + s . z
has, in w = (u, s), the Hessian [[M, J^T], [J, 0]], so that

    M udot - J^T lambda = tau + forces - damping * u - bias
    J udot = -(dz/dt at udot = 0)

is one `solve_nodes` of F, with lambda = -s. F serves for its Hessian alone: of rows that no function of positions has
as its rate, the motion is not the stationary one of L + s . z, and nothing else is derived from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, Order, building, cotangents, hessian_nodes, ldl_solve, solve_nodes, topological

from ...systems.system import System
from ..bias_terms import BiasTerms
from ..formulations.formulations import ONE, ZERO
from .constraint_rank import independent_rows


class Rows(NamedTuple):
    """The independent rows z of a system's constraints, and the multipliers in F = L + s . z."""

    kept: tuple[int, ...]  # of all rows
    rates: list[Node]  # z
    multipliers: list[Node]  # s

    def function(self, lagrangian: Node, build: Builder) -> Node:
        """F = L + s . z."""
        with building(build):
            for s, z in zip(self.multipliers, self.rates, strict=True):
                lagrangian = lagrangian + s * z
        return lagrangian


def constraint_rows(system: System, rates: Sequence[Node]) -> Rows:
    """The rows that a system is solved with, of all as they are folded; none of a system without constraints.

    Raises ConstraintError for constraints that cannot be met together.
    """
    kept = independent_rows(system.constraints) if len(system.constraints) else ()
    return Rows(kept, [rates[k] for k in kept], cg.variables([f"lambda{k}" for k in kept]))


def held_still(system: System) -> bool:
    """Whether constraints that do not depend on time leave no motion: as many independent ones as velocities."""
    rates = system.constraints.rates
    return len(rates) >= system.n == len(independent_rows(system.constraints)) and system.t not in topological(rates)


def unknown_names(system: System) -> list[str]:
    """What `solve_nodes` solves for, in words: velocities, then independent constraints."""
    kept = independent_rows(system.constraints) if len(system.constraints) else ()
    names = [f"constraint {system.constraints.names[k]!r}" for k in kept]
    return [*[f"coordinate {name!r}" for name in system.velocities], *names]


def require_no_constraints(system: System) -> None:
    """Raises ValueError for a system with constraints: their multipliers have no place in the balanced order."""
    if len(system.constraints):
        name = system.constraints.names[0]
        raise ValueError(f'method "balanced" needs a system without constraints, got constraint {name!r}')


def solved_by_elimination(
    system: System,
    terms: BiasTerms,
    rows: Rows,
    rhs: Sequence[Node],
    at: dict[Node, Node],
    build: Builder,
    check: bool,
    order: Order,
) -> list[Node]:
    """(udot, s) and with `check` the info, without forming a matrix."""
    s = rows.multipliers
    function = rows.function(terms.lagrangian, build)
    return solve_nodes(function, [*system.qd, *s], rhs, build, at=at, multipliers=s, check=check, order=order)


class DenseSolver:
    """The same by LDL^T of the whole matrix, the rows of the multipliers eliminated last, for any right-hand sides.

    composites: take M as bodies give it, `System.mass_matrix`, which has fewer nodes than the Hessian of L; its entries
    are rounded as wholes, and a factorization may lose the more digits, the worse M is.
    """

    def __init__(
        self, system: System, lagrangian: Node, rows: Rows, build: Builder, *, composites: bool = False
    ) -> None:
        slopes = [cotangents({z: ONE}, system.qd, build) for z in rows.rates]
        whole = system.mass_matrix(lagrangian, build) if composites else hessian_nodes(lagrangian, system.qd, build)
        self._matrix = [[ZERO] * (k + 1) for k in range(len(slopes))]
        self._matrix += [[*[slope[i] for slope in slopes], *row[: i + 1]] for i, row in enumerate(whole)]
        self._n, self._m, self._build = system.n, len(slopes), build

    def solve(self, rhs: Sequence[Node], check: bool = False) -> list[Node]:
        """(udot, s), and without rows and with `check` the info."""
        solved = ldl_solve(self._matrix, [*rhs[self._n :], *rhs[: self._n]], self._build, check=check and not self._m)
        return [*solved[self._m :], *solved[: self._m]]


def multiplier_outputs(system: System, rows: Rows, solved: Sequence[Node], build: Builder) -> dict[str, Node]:
    """lambda0.. of all rows from s of the independent ones; 0 of those that follow from others."""
    with building(build):
        values = {k: -s for k, s in zip(rows.kept, solved, strict=True)}
    return {f"lambda{k}": values.get(k, ZERO) for k in range(len(system.constraints))}
