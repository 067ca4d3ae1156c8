"""Solving with the mass matrix: one factorization, any number of right-hand sides."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents, folded, hessian_nodes, ldl_solve, solve_nodes, topological

from ..systems.system import System
from .formulations import ONE, ZERO

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
        return len(shared) + (len(sides) + len(self.x)) * len(self.column)

    def split(self) -> tuple[list[Node], Graph]:
        """What a column reads of the factorization, and the graph of one: inputs p0.., of those, b0..; outputs x0..."""
        moving = {*self.b, *self.column}
        read = dict.fromkeys([arg for node in self.column for arg in node.args if arg not in moving])
        factors = [node for node in read if node.value is None]
        p = cg.variables([f"p{k}" for k in range(len(factors))])
        b = cg.variables([f"b{i}" for i in range(len(self.b))])
        new = dict(zip([*factors, *self.b], [*p, *b], strict=True))
        for node in self.column:
            new[node] = Node(node.op, tuple([new.get(arg, arg) for arg in node.args]), node.label)
        return factors, Graph([*p, *b], {f"x{i}": new.get(node, node) for i, node in enumerate(self.x)})


def mass_solve(system: System, build: Builder, sides: Rows = ()) -> MassSolve:
    """By elimination on the graph of L, or by LDL^T of the matrix where paths are short and that saves nodes.

    sides: right-hand sides that it is for, beside the columns of M^-1.  Raises SingularError for an M that is singular
    at every state.
    """
    b = cg.variables([f"b{i}#" for i in range(system.n)])
    (lagrangian,) = folded([system.lagrangian], build)
    solved = linear(b, solve_nodes(lagrangian, system.qd, b, build))
    if _longest_path(lagrangian, system.qd) <= DENSE_PATH:
        dense = linear(b, ldl_solve(hessian_nodes(lagrangian, system.qd, build), b, build))
        if dense.size(sides) < WORTH * solved.size(sides):
            return dense
    return solved


def inverse(solve: MassSolve, build: Builder) -> list[list[Node]]:
    """Rows of M^-1: of the symmetric entries those with fewer operations, where the column is of a later coordinate."""
    n = len(solve.x)
    columns = solve.solutions([[ONE if i == j else ZERO for i in range(len(solve.b))] for j in range(n)], build)
    return [[columns[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]


def _longest_path(lagrangian: Node, velocities: Sequence[Node]) -> int:
    """The most velocities that come before one and move with it, itself among them: entries in a lower row of M."""
    momenta = cotangents({lagrangian: ONE}, velocities)
    moving = [set(topological([p])) for p in momenta]
    return max([sum([u in moving[i] for u in velocities[: i + 1]]) for i in range(len(velocities))])


def linear(b: list[Node], x: list[Node]) -> MassSolve:
    """Of nodes x that are linear in b."""
    moving, column = set(b), []
    for node in topological(x):
        if any([arg in moving for arg in node.args]):
            moving.add(node)
            column.append(node)
    return MassSolve(b, x, column)
