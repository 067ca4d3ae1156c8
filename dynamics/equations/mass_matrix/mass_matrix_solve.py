"""Solving with the mass matrix: one factorization, any number of right-hand sides."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple, TypeVar

import cgraph as cg
from cgraph import Node
from cgraph.extend import OPS, Builder, SingularError, building, cotangents, folded, topological

from ...systems.kinematics import ONE, ZERO
from ...systems.system import System
from ..constraints.constraints import constraint_rows
from ..equation import mirrored
from .singular_mass_matrix import SingularMassMatrixError

DENSE_PATH = 12  # coordinates from the world to a tip; a dense factorization loses digits with about their fourth power
WORTH = 0.8  # of the nodes by elimination, at most, for the dense one: elimination keeps more digits

Rows = Sequence[Sequence[Node]]
Solution = TypeVar("Solution")


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

    def size(self, sides: int) -> int:
        """Number of nodes of the solutions of so many right-hand sides, about."""
        return len(topological(self.x)) + sides * len(self.column)


def mass_solve(system: System, build: Builder, method: str) -> MassSolve:
    """Solution by elimination on the graph of L, "recursive", or by LDL^T of the matrix, "dense".

    With constraints M x - J^T y = b, J x = b beyond n.  Raises SingularError for an M that is singular at every state.
    """
    lagrangian, *rates = folded([system.lagrangian, *system.constraints.rates], build)
    rows = constraint_rows(system, rates)
    b = cg.variables([f"b{i}#" for i in range(system.n + len(rows.kept))])
    solve = rows.solve_densely if method == "dense" else rows.solve
    return linear(b, solve(system, lagrangian, b, build)[: system.n])


def smaller_solution(system: System, make: Callable[[str], Solution], size: Callable[[Solution], int]) -> Solution:
    """Solution that `make` makes by elimination, or densely where paths are short and that saves nodes."""
    eliminated = make("recursive")
    if _longest_path(system.lagrangian, system.qd) > DENSE_PATH:
        return eliminated
    with suppress(SingularError, SingularMassMatrixError):  # which needs rows exchanged
        if size(dense := make("dense")) < WORTH * size(eliminated):
            return dense
    return eliminated


def inverse(solve: MassSolve, build: Builder) -> list[list[Node]]:
    """Rows of M^-1: of the symmetric entries those with fewer operations, where the column is of a later coordinate."""
    return mirrored(solve.solutions(units(len(solve.x), len(solve.b)), build))


def units(count: int, length: int) -> list[list[Node]]:
    """The first unit vectors of this length."""
    return [[ONE if i == j else ZERO for i in range(length)] for j in range(count)]


def _longest_path(lagrangian: Node, velocities: Sequence[Node]) -> int:
    """The most velocities that come before one and move with it, itself among them: entries in a lower row of M."""
    momenta = cotangents({lagrangian: ONE}, velocities)
    moving = [set(topological([p])) for p in momenta]
    return max([sum([u in moving[i] for u in velocities[: i + 1]]) for i in range(len(velocities))])


def linear(b: list[Node], x: list[Node]) -> MassSolve:
    """Solution of nodes x that are linear in b; a divisor of a column multiplies it, once inverted for all."""
    moving, column = set(b), []
    new: dict[Node, Node] = {}
    inverses: dict[Node, Node] = {}
    for node in topological(x):
        if not any([arg in moving for arg in node.args]):
            continue
        moving.add(node)
        args, op = tuple([new.get(arg, arg) for arg in node.args]), node.op
        if op is OPS["div"]:  # of numbers that are linear in b, by one that is not
            inverse = inverses.setdefault(args[1], Node(op, (ONE, args[1]), node.label))
            args, op = (args[0], inverse), OPS["mul"]
        new[node] = Node(op, args, node.label)
        column.append(new[node])
    return MassSolve(b, [new.get(node, node) for node in x], column)
