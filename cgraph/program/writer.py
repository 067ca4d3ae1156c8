"""Writer: what the rules of statements write LLVM's text with."""

from __future__ import annotations

from collections.abc import Sequence

from .llvm_functions import Functions, Lengths
from .statement import Lengths as Registers, Statement, row_of


class Writer:
    """The statements of a function over registers, as LLVM's text.

    functions: those of the module, which statements call.  type, size: of a number in a register, in LLVM's language
    and in bytes.  pointers: {register: its address}.  written: lines of the statements so far.  scratch: allocations,
    which stand once at the start.  before: the statement that has been written last.
    """

    def __init__(self, registers: Registers, functions: Functions) -> None:
        self.registers, self.functions = registers, functions
        self.type, self.size = functions.arithmetic.type, 8 * functions.arithmetic.lanes
        self.pointers = {name: f"%r{number}" for number, name in enumerate(registers)}
        self.written: list[str] = []
        self.scratch: list[str] = []
        self.before: Statement | None = None
        self._count = self._values = 0  # of statements so far, and of values, for names

    def run(self, statements: Sequence[Statement]) -> None:
        """Statements, one after another."""
        for statement in statements:
            self._count += 1
            text = row_of(statement).text
            assert text is not None, "require_texts has been asked"
            text(statement, self)
            self.before = statement

    def line(self, instruction: str) -> None:
        """An instruction without a value."""
        self.written.append(f"  {instruction}")

    def value(self, instruction: str) -> str:
        """An instruction; the name of its value."""
        self._values += 1
        self.line(f"%v{self._values} = {instruction}")
        return f"%v{self._values}"

    def number(self, value: float) -> str:
        """A number in the text."""
        return self.functions.arithmetic.number(value)

    def pointer(self, register: str) -> str:
        """The address of a register."""
        return self.pointers[register]

    def place(self, register: str, k: int) -> str:
        """The address of number k of a register."""
        pointer = self.pointer(register)
        return self.value(f"getelementptr {self.type}, ptr {pointer}, i64 {k}") if k else pointer

    def load(self, register: str, k: int = 0) -> str:
        """Number k of a register."""
        return self.value(f"load {self.type}, ptr {self.place(register, k)}, align 8")

    def store(self, value: str, register: str, k: int = 0) -> None:
        """register[k] = value, a number."""
        self.line(f"store {self.type} {value}, ptr {self.place(register, k)}, align 8")

    def fill_with_nan(self, register: str) -> None:
        """register = NaN, every number of it: all bits are 1."""
        size = self.registers[register] * self.size
        self.line(f"call void @llvm.memset.p0.i64(ptr {self.pointer(register)}, i8 -1, i64 {size}, i1 false)")

    def label(self, kind: str) -> str:
        """A name for the blocks of the statement that is being written."""
        return f"{kind}{self._count}"

    def block(self, label: str) -> None:
        """Begin a block of that name."""
        self.written.append(f"{label}:")

    def jump(self, label: str) -> None:
        """Go on there."""
        self.line(f"br label %{label}")

    def branch(self, register: str, yes: str, no: str) -> None:
        """Go on where register > 0, where NaN is not, and where it is not; of lanes, where any is."""
        self.written += self.positive(f"%{yes}.on", register)
        self.line(f"br i1 %{yes}.on, label %{yes}, label %{no}")

    def arguments(self, *names: str) -> str:
        """Pointers to registers, as arguments of a call."""
        return ", ".join(f"ptr {self.pointer(name)}" for name in names)

    def calls(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Call a function of registers, whose arguments must not overlap.

        A register that it both reads and writes is written to scratch memory, and copied after the call.
        """
        targets, copies = [], []
        for k, output in enumerate(outputs):
            target, length = self.pointer(output), self.registers[output]
            if output in inputs:
                scratch = self.beside(f"beside{k}", length)
                copies.append(copy_text(target, scratch, length * self.size))
                target = scratch
            targets.append(target)
        self.call(name, [*[self.pointer(register) for register in inputs], *targets])
        self.written += copies

    def call(self, name: str, pointers: Sequence[str]) -> None:
        """Call a function of these addresses."""
        self.line(f"call void @{name}({', '.join([f'ptr {pointer}' for pointer in pointers])})")

    def beside(self, name: str, length: int) -> str:
        """The address of scratch memory of this statement for so many numbers, and for vectors that reach beyond."""
        pointer = f"%{name}.{self._count}"
        self.scratch.append(f"  {pointer} = alloca {self.type}, i64 {length + self.functions.width}, align 64")
        return pointer

    def lengths(self, names: Sequence[str]) -> Lengths:
        """Lengths of registers."""
        return tuple([self.registers[name] for name in names])

    def positive(self, result: str, register: str) -> list[str]:
        """result = register > 0, where NaN is not; of lanes, whether any is."""
        lanes, t = self.functions.arithmetic.lanes, self.type
        lines = [f"  {result}.value = load {t}, ptr {self.pointers[register]}, align 8"]
        if lanes == 1:
            return [*lines, f"  {result} = fcmp ogt double {result}.value, 0.0"]
        return [
            *lines,
            f"  {result}.each = fcmp ogt {t} {result}.value, {self.number(0.0)}",
            f"  {result}.bits = bitcast <{lanes} x i1> {result}.each to i{lanes}",
            f"  {result} = icmp ne i{lanes} {result}.bits, 0",
        ]


def copy_text(target: str, source: str, size: int) -> str:
    """Copy so many bytes from one address to another."""
    return f"  call void @llvm.memcpy.p0.p0.i64(ptr {target}, ptr {source}, i64 {size}, i1 false)"
