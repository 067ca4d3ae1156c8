"""Solving with the mass matrix: one factorization, any number of right-hand sides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, folded, hessian_nodes, ldl_solve, solve_nodes, topological

from ..systems.system import System

DENSE_PATH = 12  # coordinates from the world to a tip; a dense factorization loses digits with about their fourth power
WORTH = 0.85  # of the nodes by elimination, at most, for the dense one: elimination keeps more digits

Rows = Sequence[Sequence[Node]]


class MassSolve(NamedTuple):
    """x with M x = b, of variables b: nodes linear in them.

    column: the nodes that depend on b, arguments first, which every right-hand side takes once more.
    """

    b: list[Node]
    x: list[Node]
    column: list[Node]

    def solutions(self, sides: Rows, build: Builder) -> list[list[Node]]:
        """x of each of the right-hand sides."""
        result = []
        with building(build) as labelled:
            for side in sides:
                new = dict(zip(self.b, side, strict=True))
                for node in self.column:
                    labelled(node.label)
                    new[node] = build(node.op, tuple([new.get(arg, arg) for arg in node.args]), node.label, node.name)
                result.append([new.get(node, node) for node in self.x])
        return result

    def size(self, sides: Rows) -> int:
        """How many nodes these right-hand sides, their solutions and the columns of M^-1 take, about."""
        shared = topological([*self.x, *[node for side in sides for node in side]])
        return len(shared) + (len(sides) + len(self.b)) * len(self.column)


def mass_solve(system: System, build: Builder, sides: Rows = ()) -> MassSolve:
    """By elimination on the graph of L, or by LDL^T of the matrix where paths are short and that saves nodes.

    sides: right-hand sides that it is for, beside the columns of M^-1.  Raises SingularError for an M that is singular
    at every state.
    """
    b = cg.variables([f"b{i}#" for i in range(system.n)])
    (lagrangian,) = folded([system.lagrangian], build)
    solved = _solve(b, solve_nodes(lagrangian, system.qd, b, build))
    lower = hessian_nodes(lagrangian, system.qd, build)
    if max(sum(node.value != 0.0 for node in row[: i + 1]) for i, row in enumerate(lower)) <= DENSE_PATH:
        dense = _solve(b, ldl_solve(lower, b, build))
        if dense.size(sides) < WORTH * solved.size(sides):
            return dense
    return solved


def inverse(solve: MassSolve, build: Builder) -> list[list[Node]]:
    """Rows of M^-1: of the symmetric entries those with fewer operations, where the column is of a later coordinate."""
    n = len(solve.b)
    units = [[cg.constant(float(i == j)) for i in range(n)] for j in range(n)]
    columns = solve.solutions(units, build)
    return [[columns[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]


def _solve(b: list[Node], x: list[Node]) -> MassSolve:
    moving, column = set(b), []
    for node in topological(x):
        if any([arg in moving for arg in node.args]):
            moving.add(node)
            column.append(node)
    return MassSolve(b, x, column)
