"""LU factorization with partial pivoting, as LLVM text and in NumPy: the same operations in the same order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


def factor(a: Array, pivots: Array) -> None:
    """LU = PA in place of a (n, n), L with a unit diagonal; pivots (n,) receives the row exchanged with row k."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):
            row = k
            for i in range(k + 1, n):  # not argmax: a NaN must not win, here as in machine code
                if abs(a[i, k]) > abs(a[row, k]):
                    row = i
            pivots[k] = row
            a[[k, row]] = a[[row, k]]
            a[k + 1 :, k] /= a[k, k]  # column k of L; then the Schur complement
            a[k + 1 :, k + 1 :] -= a[k + 1 :, k, None] * a[k, k + 1 :]


def solve(a: Array, pivots: Array, b: Array) -> None:
    """The solution of A x = b in place of b (n,)."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):  # b = P b
            row = int(pivots[k])
            b[k], b[row] = b[row], b[k]
        for k in range(n):  # L y = b
            b[k + 1 :] -= a[k + 1 :, k] * b[k]
        for k in reversed(range(n)):  # U x = y
            b[k] /= a[k, k]
            b[:k] -= a[:k, k] * b[k]


def solve_transposed(a: Array, pivots: Array, b: Array) -> None:
    """The solution of A^T x = b in place of b (n,): A^T = U^T L^T P."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):  # U^T y = b
            b[k] /= a[k, k]
            b[k + 1 :] -= a[k, k + 1 :] * b[k]
        for k in reversed(range(n)):  # L^T z = y
            b[:k] -= a[k, :k] * b[k]
        for k in reversed(range(n)):  # x = P^T z
            row = int(pivots[k])
            b[k], b[row] = b[row], b[k]


class _FunctionWriter:
    """Lines of one function over doubles in memory, with loops; every value has a new name."""

    def __init__(self, flags: str) -> None:
        self.lines: list[str] = []
        self.flags = f"{flags} " if flags else ""
        self._block, self._count = "start", 0

    def value(self, instruction: str) -> str:
        """Write an instruction; the name of its value."""
        self._count += 1
        self.lines.append(f"  %t{self._count} = {instruction}")
        return f"%t{self._count}"

    def do(self, instruction: str) -> None:
        """Write an instruction without a value."""
        self.lines.append(f"  {instruction}")

    def at(self, base: str, index: str) -> str:
        """The address of base[index]."""
        return self.value(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, address: str) -> str:
        """The double at an address."""
        return self.value(f"load double, ptr {address}, align 8")

    def element(self, row: str, column: str) -> str:
        """The address of a[row, column] = a[row * n + column]."""
        return self.at("%a", self.value(f"add i64 {self.value(f'mul i64 {row}, %n')}, {column}"))

    def subtract_product(self, target: str, a: str, b: str) -> None:
        """*target -= a * b."""
        product = self.value(f"fmul {self.flags}double {a}, {b}")
        self.do(f"store double {self.value(f'fsub {self.flags}double {self.load(target)}, {product}')}, ptr {target}")

    def swap(self, a: str, b: str) -> None:
        """Exchange the doubles at two addresses."""
        first, second = self.load(a), self.load(b)
        self.do(f"store double {second}, ptr {a}, align 8")
        self.do(f"store double {first}, ptr {b}, align 8")

    @contextmanager
    def loop(self, first: str, end: str) -> Iterator[str]:
        """The lines inside, for i = first .. end - 1."""
        self._count += 1
        i, before = f"%i{self._count}", self._block
        name = i[1:]
        self.do(f"br label %{name}.top")
        self.lines += [f"{name}.top:", f"  {i} = phi i64 [ {first}, %{before} ], [ {i}.next, %{name}.again ]"]
        self.do(f"{i}.more = icmp slt i64 {i}, {end}")
        self.do(f"br i1 {i}.more, label %{name}.body, label %{name}.end")
        self.lines.append(f"{name}.body:")
        self._block = f"{name}.body"
        yield i
        self.do(f"br label %{name}.again")
        self.lines += [f"{name}.again:", f"  {i}.next = add i64 {i}, 1"]
        self.do(f"br label %{name}.top")
        self.lines.append(f"{name}.end:")
        self._block = f"{name}.end"

    def function(self, name: str, arguments: str) -> list[str]:
        """The whole definition."""
        return [f"define internal void @{name}({arguments}) nounwind {{", "start:", *self.lines, "  ret void", "}"]


def factor_text(flags: str) -> list[str]:
    """`void lu.factor(double *a, double *p, int64_t n)`, as `factor`."""
    ir = _FunctionWriter(flags)
    largest = ir.value("alloca i64, align 8")
    with ir.loop("0", "%n") as k:
        # row = argmax over i >= k of |a[i, k]|
        next_k = ir.value(f"add i64 {k}, 1")
        ir.do(f"store i64 {k}, ptr {largest}")
        with ir.loop(next_k, "%n") as i:
            row = ir.value(f"load i64, ptr {largest}")
            here, best = (ir.load(ir.element(index, k)) for index in (i, row))
            here, best = (ir.value(f"call double @llvm.fabs.f64(double {number})") for number in (here, best))
            chosen = ir.value(f"select i1 {ir.value(f'fcmp ogt double {here}, {best}')}, i64 {i}, i64 {row}")
            ir.do(f"store i64 {chosen}, ptr {largest}")
        # p[k] = row; exchange rows k and row
        row = ir.value(f"load i64, ptr {largest}")
        ir.do(f"store double {ir.value(f'sitofp i64 {row} to double')}, ptr {ir.at('%p', k)}")
        with ir.loop("0", "%n") as j:
            ir.swap(ir.element(k, j), ir.element(row, j))
        # for i > k:  l = a[i, k] /= a[k, k];  a[i, j] -= l a[k, j] for j > k
        pivot = ir.load(ir.element(k, k))
        with ir.loop(next_k, "%n") as i:
            target = ir.element(i, k)
            gain = ir.value(f"fdiv {ir.flags}double {ir.load(target)}, {pivot}")
            ir.do(f"store double {gain}, ptr {target}")
            with ir.loop(next_k, "%n") as j:
                ir.subtract_product(ir.element(i, j), gain, ir.load(ir.element(k, j)))
    return ir.function("lu.factor", "ptr %a, ptr %p, i64 %n")


def solve_text(flags: str) -> list[str]:
    """`void lu.solve(double *a, double *p, double *b, int64_t n)`, as `solve`."""
    ir = _FunctionWriter(flags)
    # b = P b
    with ir.loop("0", "%n") as k:
        row = ir.value(f"fptosi double {ir.load(ir.at('%p', k))} to i64")
        ir.swap(ir.at("%b", k), ir.at("%b", row))
    # L y = b:  b[i] -= a[i, k] b[k] for i > k, k = 0 .. n - 1
    with ir.loop("0", "%n") as k:
        value = ir.load(ir.at("%b", k))
        with ir.loop(ir.value(f"add i64 {k}, 1"), "%n") as i:
            ir.subtract_product(ir.at("%b", i), ir.load(ir.element(i, k)), value)
    # U x = y:  b[k] /= a[k, k], b[i] -= a[i, k] b[k] for i < k, k = n - 1 .. 0
    with ir.loop("0", "%n") as back:
        k = ir.value(f"sub i64 {ir.value('sub i64 %n, 1')}, {back}")
        value = ir.value(f"fdiv {ir.flags}double {ir.load(ir.at('%b', k))}, {ir.load(ir.element(k, k))}")
        ir.do(f"store double {value}, ptr {ir.at('%b', k)}")
        with ir.loop("0", k) as i:
            ir.subtract_product(ir.at("%b", i), ir.load(ir.element(i, k)), value)
    return ir.function("lu.solve", "ptr %a, ptr %p, ptr %b, i64 %n")


def solve_transposed_text(flags: str) -> list[str]:
    """`void lu.solve.transposed(double *a, double *p, double *b, int64_t n)`, as `solve_transposed`."""
    ir = _FunctionWriter(flags)
    # U^T y = b:  b[k] /= a[k, k], b[i] -= a[k, i] b[k] for i > k, k = 0 .. n - 1
    with ir.loop("0", "%n") as k:
        value = ir.value(f"fdiv {ir.flags}double {ir.load(ir.at('%b', k))}, {ir.load(ir.element(k, k))}")
        ir.do(f"store double {value}, ptr {ir.at('%b', k)}")
        with ir.loop(ir.value(f"add i64 {k}, 1"), "%n") as i:
            ir.subtract_product(ir.at("%b", i), ir.load(ir.element(k, i)), value)
    # L^T z = y:  b[i] -= a[k, i] b[k] for i < k, k = n - 1 .. 0
    with ir.loop("0", "%n") as back:
        k = ir.value(f"sub i64 {ir.value('sub i64 %n, 1')}, {back}")
        value = ir.load(ir.at("%b", k))
        with ir.loop("0", k) as i:
            ir.subtract_product(ir.at("%b", i), ir.load(ir.element(k, i)), value)
    # x = P^T z
    with ir.loop("0", "%n") as back:
        k = ir.value(f"sub i64 {ir.value('sub i64 %n, 1')}, {back}")
        row = ir.value(f"fptosi double {ir.load(ir.at('%p', k))} to i64")
        ir.swap(ir.at("%b", k), ir.at("%b", row))
    return ir.function("lu.solve.transposed", "ptr %a, ptr %p, ptr %b, i64 %n")
