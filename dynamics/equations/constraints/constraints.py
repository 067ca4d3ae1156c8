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
from cgraph._shared import Order, ldl_solve
from cgraph.extend import Builder, building, cotangents, hessian_nodes, solve_nodes, topological

from ...systems.kinematics import ONE, ZERO
from ...systems.system import System
from .constraint_rank import independent_rows


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
