"""FunctionWriter: LLVM's text of a function with loops, over numbers or over vectors of a number for each lane."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import NamedTuple

REGISTERS = 13  # values that fit in the registers of any processor at once, some registers left over


class Arithmetic(NamedTuple):
    """Liberties of the instructions of a function, and the numbers that they work on at once."""

    flags: str = ""  # fast-math flags: none is strict IEEE
    lanes: int = 1  # doubles in a vector
    registers: int = REGISTERS  # values that are in registers at once
    together: int = 1  # at most so many arguments go into one call of a vector function, where lanes is 1
    alike: bool = False  # whether each lane has the bits of one point: libm's where a function has no company there

    @property
    def polynomials(self) -> bool:
        """Whether vectors have sines, exponentials, .. from polynomials; strict IEEE has libm's bits everywhere."""
        return bool(self.flags)

    @property
    def fuses(self) -> bool:
        """Whether a product and its sum are one instruction: which ones is said, so that it is the same everywhere."""
        return self.flags == "contract"

    @property
    def unfused(self) -> Arithmetic:
        """The same, but that products are rounded by themselves, so that what cancels is 0."""
        return self._replace(flags="nsz") if self.fuses else self

    @property
    def type(self) -> str:
        """The type of a value."""
        return "double" if self.lanes == 1 else f"<{self.lanes} x double>"

    @property
    def suffix(self) -> str:
        """The type of a value in names of intrinsic functions."""
        return "f64" if self.lanes == 1 else f"v{self.lanes}f64"

    def number(self, value: float) -> str:
        """The constant, to the last bit."""
        return bits(value) if self.lanes == 1 else f"splat (double {bits(value)})"

    def splat(self, name: str, value: str) -> list[str]:
        """The vector `name` of equal numbers."""
        t, same = self.type, f"<{self.lanes} x i32> zeroinitializer"
        return [
            f"  {name}.first = insertelement {t} poison, double {value}, i32 0",
            f"  {name} = shufflevector {t} {name}.first, {t} poison, {same}",
        ]


def words_of(arithmetic: Arithmetic) -> dict[str, str]:
    """Words that the column `llvm` of the operation table names."""
    return {
        "t": arithmetic.type,
        "b": "i1" if arithmetic.lanes == 1 else f"<{arithmetic.lanes} x i1>",
        "s": arithmetic.suffix,
        "f": f"{arithmetic.flags} " if arithmetic.flags and not arithmetic.fuses else "",
        "zero": arithmetic.number(0.0),
        "one": arithmetic.number(1.0),
        "minus": arithmetic.number(-1.0),
    }


def bits(value: float) -> str:
    """A double in LLVM's language."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"


class FunctionWriter:
    """Lines of one function over numbers in memory, with loops and conditions; every value has a new name.

    type, bits: of a number (a double, or a vector of lanes) and of a condition, in LLVM's language.
    lines: what has been written.  scratch: allocations, which stand once at the start.
    """

    def __init__(self, arithmetic: Arithmetic) -> None:
        self.arithmetic, self.lanes, self.type = arithmetic, arithmetic.lanes, arithmetic.type
        self.bits = words_of(arithmetic)["b"]
        self.lines: list[str] = []
        self.scratch: list[str] = []
        self._block, self._count = "start", 0

    def _named(self, kind: str) -> str:
        self._count += 1
        return f"%{kind}{self._count}"

    def value(self, instruction: str) -> str:
        """Write an instruction; the name of its value."""
        name = self._named("t")
        self.lines.append(f"  {name} = {instruction}")
        return name

    def line(self, instruction: str) -> None:
        """Write an instruction without a value."""
        self.lines.append(f"  {instruction}")

    def number(self, value: str | float) -> str:
        """A constant number; a value's name as it is."""
        return value if isinstance(value, str) else self.arithmetic.number(value)

    def room(self, count: int = 1, kind: str = "") -> str:
        """The address of memory of this call for so many numbers, or values of another kind."""
        name = self._named("m")
        self.scratch.append(f"  {name} = alloca {kind or self.type}, i64 {count}, align 64")
        return name

    def at(self, base: str, index: str | int, kind: str = "") -> str:
        """The address of base[index], where numbers lie, or values of another kind."""
        if index in (0, "0"):
            return base
        return self.value(f"getelementptr {kind or self.type}, ptr {base}, i64 {index}")

    def load_at(self, address: str, kind: str = "") -> str:
        """The number, or value of another kind, at an address."""
        return self.value(f"load {kind or self.type}, ptr {address}, align 8")

    def store_at(self, value: str | int, address: str, kind: str = "") -> None:
        """A number, or value of another kind, to an address."""
        self.line(f"store {kind or self.type} {value}, ptr {address}, align 8")

    def copy_bytes(self, target: str, source: str, size: int) -> None:
        """Copy so many bytes from one address to another."""
        self.line(f"call void @llvm.memcpy.p0.p0.i64(ptr {target}, ptr {source}, i64 {size}, i1 false)")

    def change(self, address: str, change: str) -> None:
        """Add to an integer, with "add ..", or take from it, with "sub ..", in memory."""
        name, by = change.split()
        self.store_at(self.value(f"{name} i64 {self.load_at(address, 'i64')}, {by}"), address, "i64")

    def integer(self, operation: str, a: str, b: str | int) -> str:
        """An operation on integers, or their comparison, as "icmp slt"."""
        return self.value(f"{operation} i64 {a}, {b}")

    def apply(self, operation: str, a: str | float, b: str | float, exact: bool = False) -> str:
        """An operation on two numbers, such as "fadd"; exact: with no flag but "contract"."""
        flags = [f"{flag} " for flag in self.arithmetic.flags.split() if flag == "contract" or not exact]
        return self.value(f"{operation} {''.join(flags)}{self.type} {self.number(a)}, {self.number(b)}")

    def compare(self, relation: str, a: str, b: str | float) -> str:
        """Where two numbers are so, as "ogt", in every lane."""
        return self.value(f"fcmp {relation} {self.type} {a}, {self.number(b)}")

    def choose(self, condition: str, a: str, b: str | float) -> str:
        """a, or b in the lanes where the condition does not hold."""
        return self.value(f"select {self.bits} {condition}, {self.type} {a}, {self.type} {self.number(b)}")

    def mask(self, condition: str) -> str:
        """A condition of lanes as an integer, a bit each."""
        return self.value(f"bitcast {self.bits} {condition} to i{self.lanes}")

    def some(self, condition: str) -> str:
        """Whether a condition holds in any lane."""
        return condition if self.lanes == 1 else self.value(f"icmp ne i{self.lanes} {self.mask(condition)}, 0")

    def spread(self, double: str) -> str:
        """A double in every lane."""
        if self.lanes == 1:
            return double
        name = self._named("t")
        self.lines += self.arithmetic.splat(name, double)
        return name

    def block(self, label: str) -> None:
        """Begin a block of that name."""
        self.lines.append(f"{label}:")
        self._block = label

    def jump(self, label: str) -> None:
        """Go on there."""
        self.line(f"br label %{label}")

    def fork(self, condition: str, yes: str, no: str) -> None:
        """Go on there, or where a condition does not hold there."""
        self.line(f"br i1 {condition}, label %{yes}, label %{no}")

    @contextmanager
    def when(self, condition: str) -> Iterator[Callable[[], None]]:
        """The lines inside, if a condition holds; behind a call of what it gives, those where it does not."""
        name = self._named("if")[1:]

        def otherwise() -> None:
            self.jump(f"{name}.end")
            self.block(f"{name}.no")

        fork = len(self.lines)
        self.block(f"{name}.yes")
        yield otherwise
        no = "no" if f"{name}.no:" in self.lines[fork:] else "end"
        self.lines.insert(fork, f"  br i1 {condition}, label %{name}.yes, label %{name}.{no}")
        self.jump(f"{name}.end")
        self.block(f"{name}.end")

    @contextmanager
    def loop(self, first: str | int, end: str | int, step: int = 1) -> Iterator[str]:
        """The lines inside, for i = first, first + step, .. below end."""
        i, before = self._named("i"), self._block
        name = i[1:]
        if not (isinstance(first, int) and isinstance(end, int) and first < end):
            self.fork(self.integer("icmp slt", str(first), end), f"{name}.each", f"{name}.end")
        else:
            self.jump(f"{name}.each")
        self.block(f"{name}.each")
        self.lines.append(f"  {i} = phi i64 [ {first}, %{before} ], [ {i}.next, %{name}.again ]")
        yield i
        self.jump(f"{name}.again")
        self.block(f"{name}.again")
        self.line(f"{i}.next = add i64 {i}, {step}")
        self.line(f"{i}.more = icmp slt i64 {i}.next, {end}")
        self.fork(f"{i}.more", f"{name}.each", f"{name}.end")
        self.block(f"{name}.end")

    @contextmanager
    def repeat(self) -> Iterator[str]:
        """The lines inside, again and again, until they leave for the end, whose label it gives."""
        name = self._named("again")[1:]
        self.jump(name)
        self.block(name)
        yield f"{name}.end"
        self.jump(name)
        self.block(f"{name}.end")

    def leave_unless(self, condition: str, end: str) -> None:
        """Go on behind a loop if a condition does not hold."""
        label = self._named("on")[1:]
        self.fork(condition, label, end)
        self.block(label)

    def each_lane(self) -> AbstractContextManager[str]:
        """The lines inside, for every lane."""
        return nullcontext("0") if self.lanes == 1 else self.loop(0, self.lanes)

    def double_at(self, base: str, index: str, lane: str) -> str:
        """The address of one lane of base[index]."""
        if self.lanes == 1:
            return self.at(base, index)
        return self.at(base, self.integer("add", self.integer("mul", index, self.lanes), lane), "double")

    def function(self, head: str, result: str = "void") -> list[str]:
        """The whole definition."""
        return [f"define {head} {{", "start:", *self.scratch, *self.lines, f"  ret {result}", "}"]
