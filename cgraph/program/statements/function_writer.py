"""FunctionWriter: LLVM's text of a function with loops, over numbers or over vectors of a number for each lane."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ...codegen.arithmetic import Arithmetic


class FunctionWriter:
    """Lines of one function over numbers in memory, with loops; every value has a new name.

    A number is a double, or a vector of one for each lane.
    """

    def __init__(self, arithmetic: Arithmetic) -> None:
        self.lines: list[str] = []
        self.lanes, self.type, self._suffix = arithmetic.lanes, arithmetic.type, arithmetic.suffix
        self.flags = f"{arithmetic.flags} " if arithmetic.flags else ""
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
        return self.value(f"getelementptr {self.type}, ptr {base}, i64 {index}")

    def load(self, address: str) -> str:
        """The number at an address."""
        return self.value(f"load {self.type}, ptr {address}, align 8")

    def store(self, value: str, address: str) -> None:
        """A number to an address."""
        self.do(f"store {self.type} {value}, ptr {address}, align 8")

    def index(self, row: str, column: str) -> str:
        """The place of a[row, column] in a, row * n + column."""
        return self.value(f"add i64 {self.value(f'mul i64 {row}, %n')}, {column}")

    def element(self, row: str, column: str) -> str:
        """The address of a[row, column]."""
        return self.at("%a", self.index(row, column))

    def absolute(self, number: str) -> str:
        """Absolute value of a number."""
        return self.value(f"call {self.type} @llvm.fabs.{self._suffix}({self.type} {number})")

    def everywhere(self, integer: str) -> str:
        """An integer as a number, in every lane."""
        number = self.value(f"sitofp i64 {integer} to double")
        if self.lanes == 1:
            return number
        first = self.value(f"insertelement {self.type} poison, double {number}, i32 0")
        same = f"<{self.lanes} x i32> zeroinitializer"
        return self.value(f"shufflevector {self.type} {first}, {self.type} poison, {same}")

    def above(self, a: str, b: str) -> str:
        """Whether a > b, where NaN is not, in every lane."""
        return self.value(f"fcmp ogt {self.type} {a}, {b}")

    def choose(self, condition: str, a: str, b: str) -> str:
        """a, or b where the condition does not hold."""
        bits = "i1" if self.lanes == 1 else f"<{self.lanes} x i1>"
        return self.value(f"select {bits} {condition}, {self.type} {a}, {self.type} {b}")

    def subtract_product(self, target: str, a: str, b: str) -> None:
        """*target -= a * b."""
        product = self.value(f"fmul {self.flags}{self.type} {a}, {b}")
        self.store(self.value(f"fsub {self.flags}{self.type} {self.load(target)}, {product}"), target)

    def divide(self, target: str, divisor: str) -> str:
        """*target /= divisor; the quotient."""
        quotient = self.value(f"fdiv {self.flags}{self.type} {self.load(target)}, {divisor}")
        self.store(quotient, target)
        return quotient

    @contextmanager
    def each_lane(self) -> Iterator[str]:
        """The lines inside, for every lane."""
        if self.lanes == 1:
            yield "0"
            return
        with self.loop("0", f"{self.lanes}") as lane:
            yield lane

    def double_at(self, base: str, index: str, lane: str) -> str:
        """The address of one lane of base[index]."""
        if self.lanes == 1:
            return self.at(base, index)
        first = self.value(f"mul i64 {index}, {self.lanes}")
        return self.value(f"getelementptr double, ptr {base}, i64 {self.value(f'add i64 {first}, {lane}')}")

    def load_double(self, address: str) -> str:
        """The number of one lane."""
        return self.value(f"load double, ptr {address}, align 8")

    def exchange(self, base: str, first: str, second: str, lane: str) -> None:
        """Exchange base[first] and base[second] in one lane."""
        a, b = self.double_at(base, first, lane), self.double_at(base, second, lane)
        at_a, at_b = self.load_double(a), self.load_double(b)
        self.do(f"store double {at_b}, ptr {a}, align 8")
        self.do(f"store double {at_a}, ptr {b}, align 8")

    def pivot(self, k: str, lane: str) -> str:
        """The row p[k] of one lane; k where that is none, as in a lane that is not asked for."""
        number = self.load_double(self.double_at("%p", k, lane))
        if self.lanes > 1:
            sides = ("oge", "0.0"), ("olt", self.value("sitofp i64 %n to double"))
            low, high = [self.value(f"fcmp {relation} double {number}, {end}") for relation, end in sides]
            there, own = self.value(f"and i1 {low}, {high}"), self.value(f"sitofp i64 {k} to double")
            number = self.value(f"select i1 {there}, double {number}, double {own}")
        return self.value(f"fptosi double {number} to i64")

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
