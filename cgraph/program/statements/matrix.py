"""Factor, Solve: linear equations of a matrix in a register."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...core.evaluation import Array
from ..statement import Lengths, Statement, length_of, require_length
from . import lu_solve

if TYPE_CHECKING:
    from ..execution import Execution
    from ..writer import Writer

State = dict[str, list[float]]


@dataclass(frozen=True)
class Factor(Statement):
    """LU = PA in place of a matrix A, with partial pivoting.

    Of a singular matrix a pivot is 0, and `Solve` then gives infinities or NaN.

    Attributes
    ----------
    matrix : str
        A register of length n * n: A, row by row.
    pivots : str
        A register of length n, which receives the row exchanges.

    Examples
    --------
    >>> from cgraph.extend import Factor, Program, Solve
    >>> program = Program({"A": 4, "p": 2, "b": 2}, [Factor("A", "p"), Solve("A", "p", "b")], record=["b"])
    """

    matrix: str
    pivots: str


@dataclass(frozen=True)
class Solve(Statement):
    """The solution of A x = b in place of b, or of A^T x = b.

    Attributes
    ----------
    matrix, pivots : str
        The registers of A and its row exchanges, after `Factor`.
    vector : str
        A register of length n: b, then x.
    transposed : bool
        Whether the equations are those of A^T.

    Examples
    --------
    >>> from cgraph.extend import Program, Solve, runner
    >>> solve = runner(Program({"LU": 1, "p": 1, "b": 1}, [Solve("LU", "p", "b")], record=["b"]))
    >>> solve.run(solve.memory({"LU": 2.0, "p": 0.0, "b": 6.0}), passes=1).rows.tolist()
    [[3.0]]
    """

    matrix: str
    pivots: str
    vector: str
    transposed: bool = False


def check_matrix(statement: Factor | Solve, lengths: Lengths) -> None:
    """Raises GraphError if the registers are no n * n, n and n numbers."""
    where = type(statement).__name__
    n = length_of(lengths, where, statement.pivots)
    require_length(lengths, where, statement.matrix, n * n)
    if isinstance(statement, Solve):
        require_length(lengths, where, statement.vector, n)


def run_factor(statement: Factor, state: State, _: Execution) -> None:
    """In Python."""
    n = len(state[statement.pivots])
    a, p = np.array(state[statement.matrix]).reshape(n, n), np.empty(n)
    lu_solve.factor(a, p)
    state[statement.matrix], state[statement.pivots] = a.ravel().tolist(), p.tolist()


def run_solve(statement: Solve, state: State, _: Execution) -> None:
    """In Python."""
    n = len(state[statement.pivots])
    a, p, b = np.array(state[statement.matrix]), np.array(state[statement.pivots]), np.array(state[statement.vector])
    _solve(statement)(a.reshape(n, n), p, b)
    state[statement.vector] = b.tolist()


def factor_beside(statement: Factor, state: dict[str, Array], _: Execution) -> None:
    """Of many memories, each with pivots of its own."""
    pivots = np.empty_like(state[statement.pivots])
    n, count = pivots.shape
    a = np.array(state[statement.matrix])
    lu_solve.factor(a.reshape(n, n, count), pivots)
    state[statement.matrix], state[statement.pivots] = a, pivots


def solve_beside(statement: Solve, state: dict[str, Array], _: Execution) -> None:
    """Of many memories."""
    pivots, b = state[statement.pivots], np.array(state[statement.vector])
    n, count = b.shape
    _solve(statement)(state[statement.matrix].reshape(n, n, count), pivots, b)
    state[statement.vector] = b


def _solve(statement: Solve) -> Callable[[Array, Array, Array], None]:
    return lu_solve.solve_transposed if statement.transposed else lu_solve.solve


def factor_text(statement: Factor, writer: Writer) -> None:
    """As machine code."""
    n = writer.registers[statement.pivots]
    name = writer.functions.text("lu.factor", lu_solve.factor_text)
    writer.line(f"call void @{name}({writer.arguments(statement.matrix, statement.pivots)}, i64 {n})")


def solve_text(statement: Solve, writer: Writer) -> None:
    """As machine code."""
    n = writer.registers[statement.pivots]
    name, text = "lu.solve", lu_solve.solve_text
    if statement.transposed:
        name, text = "lu.solve.transposed", lu_solve.solve_transposed_text
    arguments = writer.arguments(statement.matrix, statement.pivots, statement.vector)
    writer.line(f"call void @{writer.functions.text(name, text)}({arguments}, i64 {n})")
