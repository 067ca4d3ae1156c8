"""LU factorisation with partial pivoting, as LLVM text and in NumPy: the same operations in the same order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


def factor(a: Array, pivots: Array) -> None:
    """LU = PA in place of a (n, n); pivots (n,) receives the row that row k changed places with."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):
            row = k
            for i in range(k + 1, n):  # not argmax: a NaN must not win, here as in machine code
                if abs(a[i, k]) > abs(a[row, k]):
                    row = i
            pivots[k] = row
            a[[k, row]] = a[[row, k]]
            a[k + 1 :, k] /= a[k, k]
            a[k + 1 :, k + 1 :] -= a[k + 1 :, k, None] * a[k, k + 1 :]


def solve(a: Array, pivots: Array, b: Array) -> None:
    """The solution of A x = b in place of b (n,)."""
    n = len(a)
    with np.errstate(all="ignore"):
        for k in range(n):
            row = int(pivots[k])
            b[k], b[row] = b[row], b[k]
        for k in range(n):
            b[k + 1 :] -= a[k + 1 :, k] * b[k]
        for k in reversed(range(n)):
            b[k] /= a[k, k]
            b[:k] -= a[:k, k] * b[k]


class _Text:
    """Lines of one function, with loops."""

    def __init__(self, flags: str) -> None:
        self.lines: list[str] = []
        self.flags = f"{flags} " if flags else ""
        self._block, self._count = "start", 0

    def new(self, instruction: str) -> str:
        """One more value, and its name."""
        self._count += 1
        self.lines.append(f"  %t{self._count} = {instruction}")
        return f"%t{self._count}"

    def do(self, instruction: str) -> None:
        """An instruction without a value."""
        self.lines.append(f"  {instruction}")

    def at(self, base: str, index: str) -> str:
        """The address of an element."""
        return self.new(f"getelementptr double, ptr {base}, i64 {index}")

    def load(self, address: str) -> str:
        """The double at an address."""
        return self.new(f"load double, ptr {address}, align 8")

    def element(self, row: str, column: str) -> str:
        """The address of a matrix element."""
        return self.at("%a", self.new(f"add i64 {self.new(f'mul i64 {row}, %n')}, {column}"))

    def subtract_product(self, target: str, a: str, b: str) -> None:
        """target -= a * b."""
        product = self.new(f"fmul {self.flags}double {a}, {b}")
        self.do(f"store double {self.new(f'fsub {self.flags}double {self.load(target)}, {product}')}, ptr {target}")

    def swap(self, a: str, b: str) -> None:
        """Exchange the doubles at two addresses."""
        first, second = self.load(a), self.load(b)
        self.do(f"store double {second}, ptr {a}, align 8")
        self.do(f"store double {first}, ptr {b}, align 8")

    @contextmanager
    def loop(self, first: str, end: str) -> Iterator[str]:
        """For i from `first` up to `end`, which is left out."""
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
    to = _Text(flags)
    largest = to.new("alloca i64, align 8")
    with to.loop("0", "%n") as k:
        next_k = to.new(f"add i64 {k}, 1")
        to.do(f"store i64 {k}, ptr {largest}")
        with to.loop(next_k, "%n") as i:
            row = to.new(f"load i64, ptr {largest}")
            here, best = (to.load(to.element(each, k)) for each in (i, row))
            here, best = (to.new(f"call double @llvm.fabs.f64(double {each})") for each in (here, best))
            chosen = to.new(f"select i1 {to.new(f'fcmp ogt double {here}, {best}')}, i64 {i}, i64 {row}")
            to.do(f"store i64 {chosen}, ptr {largest}")
        row = to.new(f"load i64, ptr {largest}")
        to.do(f"store double {to.new(f'sitofp i64 {row} to double')}, ptr {to.at('%p', k)}")
        with to.loop("0", "%n") as j:
            to.swap(to.element(k, j), to.element(row, j))
        pivot = to.load(to.element(k, k))
        with to.loop(next_k, "%n") as i:
            target = to.element(i, k)
            gain = to.new(f"fdiv {to.flags}double {to.load(target)}, {pivot}")
            to.do(f"store double {gain}, ptr {target}")
            with to.loop(next_k, "%n") as j:
                to.subtract_product(to.element(i, j), gain, to.load(to.element(k, j)))
    return to.function("lu.factor", "ptr %a, ptr %p, i64 %n")


def solve_text(flags: str) -> list[str]:
    """`void lu.solve(double *a, double *p, double *b, int64_t n)`, as `solve`."""
    to = _Text(flags)
    with to.loop("0", "%n") as k:
        row = to.new(f"fptosi double {to.load(to.at('%p', k))} to i64")
        to.swap(to.at("%b", k), to.at("%b", row))
    with to.loop("0", "%n") as k:
        value = to.load(to.at("%b", k))
        with to.loop(to.new(f"add i64 {k}, 1"), "%n") as i:
            to.subtract_product(to.at("%b", i), to.load(to.element(i, k)), value)
    with to.loop("0", "%n") as back:
        k = to.new(f"sub i64 {to.new('sub i64 %n, 1')}, {back}")
        value = to.new(f"fdiv {to.flags}double {to.load(to.at('%b', k))}, {to.load(to.element(k, k))}")
        to.do(f"store double {value}, ptr {to.at('%b', k)}")
        with to.loop("0", k) as i:
            to.subtract_product(to.at("%b", i), to.load(to.element(i, k)), value)
    return to.function("lu.solve", "ptr %a, ptr %p, ptr %b, i64 %n")
