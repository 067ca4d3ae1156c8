"""Factor, Solve, Scatter: linear equations of a matrix by LU factorization with pivoting, and entries put in a matrix.

In NumPy and as LLVM text: the same operations in the same order. Arrays and memory may have an axis of lanes more, the
last: many matrices side by side, each with pivots of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...codegen.function_writer import Arithmetic, FunctionWriter
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


@dataclass(frozen=True)
class Scatter(Statement):
    """target[places[i]] = source[table[i]]; other numbers of the target stay as they are."""

    source: str
    target: str
    table: tuple[int, ...]
    places: tuple[int, ...]


def check_matrix(statement: Factor | Solve, lengths: Lengths) -> None:
    """Raises GraphError if the registers are no n * n, n and n numbers."""
    where = type(statement).__name__
    n = length_of(lengths, where, statement.pivots)
    require_length(lengths, where, statement.matrix, n * n)
    if isinstance(statement, Solve):
        require_length(lengths, where, statement.vector, n)


def run_factor(statement: Factor, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many: L has a unit diagonal."""
    flat, n = np.array(state[statement.matrix]), len(state[statement.pivots])
    a, pivots = flat.reshape(n, n, *flat.shape[1:]), np.empty((n, *flat.shape[1:]))
    with np.errstate(all="ignore"):
        for k in range(n):
            pivots[k] = _largest(a, k)
            _exchange(a, k, pivots)
            a[k + 1 :, k] /= a[k, k]  # column k of L; then the Schur complement
            a[k + 1 :, k + 1 :] -= a[k + 1 :, k, None] * a[k, k + 1 :]
    execution.write(state, statement.matrix, flat)
    execution.write(state, statement.pivots, pivots)


def run_solve(statement: Solve, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many: A = P^T L U, or A^T = U^T L^T P."""
    a, pivots, b = [np.array(state[name]) for name in (statement.matrix, statement.pivots, statement.vector)]
    a, n = a.reshape(len(b), *b.shape), len(b)
    with np.errstate(all="ignore"):
        for k in range(n) if not statement.transposed else ():
            _exchange(b, k, pivots)
        for forward in (True, False):
            for k in range(n) if forward else reversed(range(n)):
                rest = slice(k + 1, n) if forward else slice(k)
                if forward == statement.transposed:  # by U, whose diagonal is not 1
                    b[k] /= a[k, k]
                b[rest] -= (a[k, rest] if statement.transposed else a[rest, k]) * b[k]
        for k in reversed(range(n)) if statement.transposed else ():
            _exchange(b, k, pivots)
    execution.write(state, statement.vector, b)


def run_scatter(statement: Scatter, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    target = np.array(state[statement.target], dtype=np.float64)
    target[list(statement.places)] = np.asarray(state[statement.source])[list(statement.table)]
    execution.write(state, statement.target, target)


def factor_text(statement: Factor, writer: Writer) -> None:
    """Write as machine code."""
    name, registers = writer.functions.text("lu.factor", _lu_factor_text), (statement.matrix, statement.pivots)
    writer.call(name, [writer.pointer(register) for register in registers], writer.registers[statement.pivots])


def solve_text(statement: Solve, writer: Writer) -> None:
    """Write as machine code."""
    name = "lu.solve.transposed" if statement.transposed else "lu.solve"
    writer.functions.text(name, partial(_lu_solve_text, name=name, transposed=statement.transposed))
    registers = (statement.matrix, statement.pivots, statement.vector)
    writer.call(name, [writer.pointer(register) for register in registers], writer.registers[statement.pivots])


def scatter_text(statement: Scatter, writer: Writer) -> None:
    """Write as machine code."""
    name = writer.functions.take(statement.table, statement.places)
    writer.call(name, [writer.pointer(statement.source), writer.pointer(statement.target)])


def _largest(a: Array, k: int) -> Any:
    """argmax over i >= k of |a[i, k]|, in every lane; as in machine code a NaN wins in row k alone."""
    sizes = abs(a[k:, k])
    sizes[1:][np.isnan(sizes[1:])] = -1.0
    return k + np.argmax(sizes, axis=0)  # which takes the first NaN


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
    """`void lu.factor(double *a, double *p, int64_t n)`, as `run_factor`."""
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


def _lu_solve_text(arithmetic: Arithmetic, name: str, transposed: bool) -> list[str]:
    """`void lu.solve(double *a, double *p, double *b, int64_t n)`, as `run_solve`."""
    ir = _MatrixWriter(arithmetic)
    if not transposed:  # b = P b
        with ir.loop(0, "%n") as k, ir.each_lane() as lane:
            ir.exchange("%b", k, ir.pivot(k, lane), lane)
    for forward in (True, False):
        with ir.loop(0, "%n") as turn:
            k = turn if forward else ir.backwards(turn)
            at = ir.at("%b", k)
            # by U, whose diagonal is not 1:  b[k] /= a[k, k];  then b[i] -= a[i, k] b[k], of A^T a[k, i] b[k]
            value = ir.divide(at, ir.entry(k, k)) if forward == transposed else ir.load_at(at)
            with ir.loop(ir.integer("add", k, 1), "%n") if forward else ir.loop(0, k) as i:
                ir.subtract_product(ir.at("%b", i), ir.entry(k, i) if transposed else ir.entry(i, k), value)
    if transposed:  # b = P^T b
        with ir.loop(0, "%n") as turn:
            k = ir.backwards(turn)
            with ir.each_lane() as lane:
                ir.exchange("%b", k, ir.pivot(k, lane), lane)
    return ir.function(f"internal void @{name}(ptr %a, ptr %p, ptr %b, i64 %n) nounwind")
