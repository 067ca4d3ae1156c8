"""Factor, Solve: linear equations of a matrix in a register, by LU factorization with partial pivoting.

In NumPy and as LLVM text: the same operations in the same order. Arrays and memory may have an axis of lanes more, the
last: many matrices side by side, each with pivots of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...codegen.arithmetic import Arithmetic
from ...codegen.function_writer import FunctionWriter
from ...core.evaluation import Array
from ..statement import Execution, Lengths, Statement, length_of, require_length

if TYPE_CHECKING:
    from ..writer import Writer


@dataclass(frozen=True)
class Factor(Statement):
    """LU = PA in place of a matrix A (n * n), row by row, with partial pivoting; pivots (n) receives the row exchanges.

    Of a singular matrix a pivot is 0, and `Solve` then gives infinities or NaN.

    >>> from cgraph.extend import Factor, Program, Solve
    >>> program = Program({"A": 4, "p": 2, "b": 2}, [Factor("A", "p"), Solve("A", "p", "b")], record=["b"])
    """

    matrix: str
    pivots: str


@dataclass(frozen=True)
class Solve(Statement):
    """The solution of A x = b, or transposed of A^T x = b, in place of b, the vector; A and its pivots after `Factor`.

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


def run_factor(statement: Factor, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    a, n = np.array(state[statement.matrix]), len(state[statement.pivots])
    pivots = np.empty((n, *a.shape[1:]))
    _factor(a.reshape(n, n, *a.shape[1:]), pivots)
    execution.write(state, statement.matrix, a)
    execution.write(state, statement.pivots, pivots)


def run_solve(statement: Solve, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    a, pivots, b = [np.array(state[name]) for name in (statement.matrix, statement.pivots, statement.vector)]
    _solver(statement)(a.reshape(len(b), *b.shape), pivots, b)
    execution.write(state, statement.vector, b)


def _solver(statement: Solve) -> Callable[[Array, Array, Array], None]:
    return _solve_transposed if statement.transposed else _solve


def factor_text(statement: Factor, writer: Writer) -> None:
    """Write as machine code."""
    n = writer.registers[statement.pivots]
    name = writer.functions.text("lu.factor", _lu_factor_text)
    writer.call(name, [writer.pointer(each) for each in (statement.matrix, statement.pivots)], n)


def solve_text(statement: Solve, writer: Writer) -> None:
    """Write as machine code."""
    n = writer.registers[statement.pivots]
    name, text = "lu.solve", _lu_solve_text
    if statement.transposed:
        name, text = "lu.solve.transposed", _lu_solve_transposed_text
    registers = statement.matrix, statement.pivots, statement.vector
    writer.call(writer.functions.text(name, text), [writer.pointer(each) for each in registers], n)


def _factor(a: Array, pivots: Array) -> None:
    """LU = PA in place of a (n, n), L with a unit diagonal; pivots (n,) receives the row exchanged with row k."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):
            pivots[k] = _largest(a, k)
            _exchange(a, k, pivots)
            a[k + 1 :, k] /= a[k, k]  # column k of L; then the Schur complement
            a[k + 1 :, k + 1 :] -= a[k + 1 :, k, None] * a[k, k + 1 :]


def _solve(a: Array, pivots: Array, b: Array) -> None:
    """The solution of A x = b in place of b (n,)."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):  # b = P b
            _exchange(b, k, pivots)
        for k in range(n):  # L y = b
            b[k + 1 :] -= a[k + 1 :, k] * b[k]
        for k in reversed(range(n)):  # U x = y
            b[k] /= a[k, k]
            b[:k] -= a[:k, k] * b[k]


def _solve_transposed(a: Array, pivots: Array, b: Array) -> None:
    """The solution of A^T x = b in place of b (n,): A^T = U^T L^T P."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):  # U^T y = b
            b[k] /= a[k, k]
            b[k + 1 :] -= a[k, k + 1 :] * b[k]
        for k in reversed(range(n)):  # L^T z = y
            b[:k] -= a[k, :k] * b[k]
        for k in reversed(range(n)):  # x = P^T z
            _exchange(b, k, pivots)


def _largest(a: Array, k: int) -> Any:
    """argmax over i >= k of |a[i, k]|, in every lane: not NumPy's, since a NaN must not win, as in machine code."""
    row: Any = k
    if a.ndim == 2:
        for i in range(k + 1, len(a)):
            if abs(a[i, k]) > abs(a[row, k]):
                row = i
        return row
    best = np.abs(a[k, k])
    for i in range(k + 1, len(a)):
        size = np.abs(a[i, k])
        row, best = np.where(size > best, i, row), np.where(size > best, size, best)
    return row


def _exchange(b: Array, k: int, pivots: Array) -> None:
    """Rows k and pivots[k]; in a lane that is not asked for, where this is no row, row k with itself."""
    if pivots.ndim == 1:
        if (row := int(pivots[k])) != k:
            b[[k, row]] = b[[row, k]]
        return
    lanes, there = np.arange(b.shape[-1]), (pivots[k] >= 0.0) & (pivots[k] < len(b))
    rows = np.where(there, pivots[k], k).astype(int)
    b[k], b[rows, ..., lanes] = np.moveaxis(b[rows, ..., lanes], 0, -1), np.moveaxis(b[k].copy(), -1, 0)


class _MatrixWriter(FunctionWriter):
    """A function of a matrix %a, n * n, row by row, and its pivots %p."""

    def place(self, row: str, column: str) -> str:
        """The place of a[row, column] in a, row * n + column."""
        return self.integer("add", self.integer("mul", row, "%n"), column)

    def element(self, row: str, column: str) -> str:
        """The address of a[row, column]."""
        return self.at("%a", self.place(row, column))

    def entry(self, row: str, column: str) -> str:
        """a[row, column]."""
        return self.load_at(self.element(row, column))

    def subtract_product(self, target: str, a: str, b: str) -> None:
        """*target -= a * b."""
        product = self.apply("fmul", a, b)
        self.store_at(self.apply("fsub", self.load_at(target), product), target)

    def divide(self, target: str, divisor: str) -> str:
        """*target /= divisor; the quotient."""
        quotient = self.apply("fdiv", self.load_at(target), divisor)
        self.store_at(quotient, target)
        return quotient

    def backwards(self, i: str) -> str:
        """n - 1 - i."""
        return self.integer("sub", self.integer("sub", "%n", 1), i)

    def exchange(self, base: str, first: str, second: str, lane: str) -> None:
        """Exchange base[first] and base[second] in one lane."""
        places = [self.double_at(base, each, lane) for each in (first, second)]
        numbers = [self.load_at(place, "double") for place in places]
        for number, place in zip(reversed(numbers), places, strict=True):
            self.store_at(number, place, "double")

    def pivot(self, k: str, lane: str) -> str:
        """The row p[k] of one lane; k where that is none, as in a lane that is not asked for."""
        number = self.load_at(self.double_at("%p", k, lane), "double")
        if self.lanes > 1:
            sides = ("oge", "0.0"), ("olt", self.value("sitofp i64 %n to double"))
            low, high = [self.value(f"fcmp {relation} double {number}, {end}") for relation, end in sides]
            there, own = self.value(f"and i1 {low}, {high}"), self.value(f"sitofp i64 {k} to double")
            number = self.value(f"select i1 {there}, double {number}, double {own}")
        return self.value(f"fptosi double {number} to i64")


def _lu_factor_text(arithmetic: Arithmetic) -> list[str]:
    """`void lu.factor(double *a, double *p, int64_t n)`, as `factor`."""
    ir = _MatrixWriter(arithmetic)
    best, chosen = ir.room(), ir.room()

    def size(i: str, k: str) -> str:
        return ir.value(f"call {ir.type} @llvm.fabs.{arithmetic.suffix}({ir.type} {ir.entry(i, k)})")

    def number(i: str) -> str:
        return ir.spread(ir.value(f"sitofp i64 {i} to double"))

    with ir.loop(0, "%n") as k:
        # p[k] = argmax over i >= k of |a[i, k]|
        next_k = ir.integer("add", k, 1)
        ir.store_at(size(k, k), best)
        ir.store_at(number(k), chosen)
        with ir.loop(next_k, "%n") as i:
            here, before = size(i, k), ir.load_at(best)
            larger = ir.compare("ogt", here, before)
            ir.store_at(ir.choose(larger, here, before), best)
            ir.store_at(ir.choose(larger, number(i), ir.load_at(chosen)), chosen)
        ir.store_at(ir.load_at(chosen), ir.at("%p", k))
        with ir.each_lane() as lane:  # exchange rows k and p[k]
            row = ir.pivot(k, lane)
            with ir.when(ir.integer("icmp ne", row, k)), ir.loop(0, "%n") as j:
                ir.exchange("%a", ir.place(k, j), ir.place(row, j), lane)
        # for i > k:  l = a[i, k] /= a[k, k];  a[i, j] -= l a[k, j] for j > k
        pivot = ir.entry(k, k)
        with ir.loop(next_k, "%n") as i:
            gain = ir.divide(ir.element(i, k), pivot)
            with ir.loop(next_k, "%n") as j:
                ir.subtract_product(ir.element(i, j), gain, ir.entry(k, j))
    return ir.function("internal void @lu.factor(ptr %a, ptr %p, i64 %n) nounwind")


def _lu_solve_text(arithmetic: Arithmetic) -> list[str]:
    """`void lu.solve(double *a, double *p, double *b, int64_t n)`, as `solve`."""
    ir = _MatrixWriter(arithmetic)
    # b = P b
    with ir.loop(0, "%n") as k, ir.each_lane() as lane:
        ir.exchange("%b", k, ir.pivot(k, lane), lane)
    # L y = b:  b[i] -= a[i, k] b[k] for i > k, k = 0 .. n - 1
    with ir.loop(0, "%n") as k:
        value = ir.load_at(ir.at("%b", k))
        with ir.loop(ir.integer("add", k, 1), "%n") as i:
            ir.subtract_product(ir.at("%b", i), ir.entry(i, k), value)
    # U x = y:  b[k] /= a[k, k], b[i] -= a[i, k] b[k] for i < k, k = n - 1 .. 0
    with ir.loop(0, "%n") as back:
        k = ir.backwards(back)
        value = ir.divide(ir.at("%b", k), ir.entry(k, k))
        with ir.loop(0, k) as i:
            ir.subtract_product(ir.at("%b", i), ir.entry(i, k), value)
    return ir.function("internal void @lu.solve(ptr %a, ptr %p, ptr %b, i64 %n) nounwind")


def _lu_solve_transposed_text(arithmetic: Arithmetic) -> list[str]:
    """`void lu.solve.transposed(double *a, double *p, double *b, int64_t n)`, as `solve_transposed`."""
    ir = _MatrixWriter(arithmetic)
    # U^T y = b:  b[k] /= a[k, k], b[i] -= a[k, i] b[k] for i > k, k = 0 .. n - 1
    with ir.loop(0, "%n") as k:
        value = ir.divide(ir.at("%b", k), ir.entry(k, k))
        with ir.loop(ir.integer("add", k, 1), "%n") as i:
            ir.subtract_product(ir.at("%b", i), ir.entry(k, i), value)
    # L^T z = y:  b[i] -= a[k, i] b[k] for i < k, k = n - 1 .. 0
    with ir.loop(0, "%n") as back:
        k = ir.backwards(back)
        value = ir.load_at(ir.at("%b", k))
        with ir.loop(0, k) as i:
            ir.subtract_product(ir.at("%b", i), ir.entry(k, i), value)
    # x = P^T z
    with ir.loop(0, "%n") as back:
        k = ir.backwards(back)
        with ir.each_lane() as lane:
            ir.exchange("%b", k, ir.pivot(k, lane), lane)
    return ir.function("internal void @lu.solve.transposed(ptr %a, ptr %p, ptr %b, i64 %n) nounwind")
