"""Writer: what the rules of statements write LLVM's text with."""

from __future__ import annotations

from collections.abc import Sequence

from ..codegen.function_writer import FunctionWriter, copied_bytes
from .llvm_functions import Functions, Lengths
from .statement import Lengths as Registers, Statement, row_of


class Writer(FunctionWriter):
    """The statements of a function over registers, as LLVM's text.

    functions: those of the module, which statements call.  size: of a number in a register, in bytes.
    pointers: {register: its address}.  before: the statement that has been written last.
    """

    def __init__(self, registers: Registers, functions: Functions) -> None:
        super().__init__(functions.arithmetic)
        self.registers, self.functions, self.size = registers, functions, 8 * self.lanes
        self.pointers = {name: f"%r{number}" for number, name in enumerate(registers)}
        self.before: Statement | None = None

    def run(self, statements: Sequence[Statement]) -> None:
        """Statements, one after another."""
        for statement in statements:
            text = row_of(statement).text
            assert text is not None, "require_texts has been asked"
            text(statement, self)
            self.before = statement

    def pointer(self, register: str) -> str:
        """The address of a register."""
        return self.pointers[register]

    def place(self, register: str, k: int) -> str:
        """The address of number k of a register."""
        return self.at(self.pointers[register], k)

    def load(self, register: str, k: int = 0) -> str:
        """Number k of a register."""
        return self.load_at(self.place(register, k))

    def store(self, value: str, register: str, k: int = 0) -> None:
        """register[k] = value, a number."""
        self.store_at(value, self.place(register, k))

    def fill_with_nan(self, register: str) -> None:
        """register = NaN, every number of it: all bits are 1."""
        size = self.registers[register] * self.size
        self.line(f"call void @llvm.memset.p0.i64(ptr {self.pointers[register]}, i8 -1, i64 {size}, i1 false)")

    def positive(self, register: str) -> str:
        """Whether register > 0, where NaN is not; of lanes, whether any is."""
        return self.some(self.compare("ogt", self.load(register), 0.0))

    def calls(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Call a function of registers, whose arguments must not overlap.

        A register that it both reads and writes is written to scratch memory, and copied after the call.
        """
        targets, copies = [], []
        for output in outputs:
            target, length = self.pointers[output], self.registers[output]
            if output in inputs:
                beside = self.beside(length)
                copies.append(copied_bytes(target, beside, length * self.size))
                target = beside
            targets.append(target)
        self.call(name, [*[self.pointers[register] for register in inputs], *targets])
        for copy in copies:
            self.line(copy)

    def call(self, name: str, pointers: Sequence[str], *integers: int) -> None:
        """Call a function of these addresses, and of integers."""
        arguments = [*[f"ptr {pointer}" for pointer in pointers], *[f"i64 {integer}" for integer in integers]]
        self.line(f"call void @{name}({', '.join(arguments)})")

    def beside(self, length: int) -> str:
        """The address of scratch memory for so many numbers, and for vectors that reach beyond."""
        return self.room(length + self.functions.width)

    def lengths(self, names: Sequence[str]) -> Lengths:
        """Lengths of registers."""
        return tuple([self.registers[name] for name in names])
