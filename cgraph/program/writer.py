"""LLVM's text of a program: a writer for the rules of statements, and the functions that these call."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from typing import Any

from ..codegen.function_writer import Arithmetic, FunctionWriter
from ..codegen.llvm_ir import libm_functions, write_graph
from ..core.graph import Graph
from ..core.node import Node
from .statement import Lengths as Registers, Statement, row_of

Lengths = tuple[int, ...]  # of the registers that are a function's arguments
Text = Callable[[FunctionWriter, str], None]  # what writes a function of that name


def offsets(registers: Registers, width: int) -> dict[str, int]:
    """Place of each register in the memory, its length padded to whole vectors; under "" the size of it all."""
    at, places = 0, {}
    for name, length in registers.items():
        places[name] = at
        at += length if length < 2 else -(-length // width) * width
    places[""] = at
    return places


def layout(registers: Registers, shared: Container[str], width: int) -> tuple[dict[str, int], int]:
    """`offsets` where registers that memories share come last, and where these begin."""
    own = {name: length for name, length in registers.items() if name not in shared}
    return offsets({**own, **registers}, width), offsets(own, width)[""]


class Functions:
    """The functions of one module, each written once: `void f(in0, in1, .., out0, out1, ..)`, pointers to registers.

    width: of the vectors in which `map` goes through its elements.  quick: whether to compile in little time.
    """

    def __init__(self, arithmetic: Arithmetic, width: int) -> None:
        self.arithmetic, self.width = arithmetic, width
        self.definitions: list[str] = []
        self.quick = False
        self._names: dict[tuple[object, ...], str] = {}

    def call(
        self,
        graph: Graph,
        registers: Lengths,
        reads: Sequence[int],
        writes: Sequence[int],
        products: Mapping[Node, Node] | None = None,
        exact: bool = False,
        begins: Lengths = (),
    ) -> str:
        """y = graph(x), where of its registers some, end to end, are x, and some y; a register may be both.

        begins: places of the registers in the memory, the function's one argument: addresses are constants then.
        """
        arithmetic = self.arithmetic.unfused if exact else self.arithmetic
        pointers = ["%in0"] if begins else [f"%in{k}" for k in range(len(registers))]
        ends = [("%in0", begin) for begin in begins] or [(pointer, 0) for pointer in pointers]
        places = [_places(arithmetic.type, *end, length) for end, length in zip(ends, registers, strict=True)]
        x, y = ([place for k in which for place in places[k]] for which in (reads, writes))

        def text(ir: FunctionWriter, name: str) -> None:
            self._body(ir, name, graph, {"x": x, "y": y}, pointers, products=products)

        key = (id(graph), registers, tuple(reads), tuple(writes), exact, begins)
        return self._define(key, "call", text, arithmetic, len(pointers), 0)

    def map(
        self, graph: Graph, shared: Lengths, inputs: Lengths, outputs: Lengths, count: int, apart: Lengths, asked: bool
    ) -> str:
        """y[i] = graph(shared, x[i]) for i = 0 .. count - 1, whose number k in a register is at k count + i.

        apart: flags of inputs whose numbers have just been written one by one, and so are read: one load of them all
        would wait until they are in the cache.  asked: whether the last input says how many elements matter.
        """
        one_each = max((*inputs, *outputs), default=1) <= count
        in_vectors = self.arithmetic.lanes == 1 and self.width > 1 and count > 1 and not libm_functions(graph)
        in_vectors = in_vectors and (one_each or count % self.width == 0)
        arithmetic = self.arithmetic._replace(lanes=self.width, together=1) if in_vectors else self.arithmetic
        same = [k for k, length in enumerate(inputs) if length == 1 != count]
        gathered = [k for k, each in enumerate(apart) if each and in_vectors and inputs[k] == count]
        first, one, vector = len(shared), self.arithmetic.type, arithmetic.type
        size = min(count, self.width)

        def gather(_: Arithmetic) -> list[str]:  # a vector by a load for each number, of which LLVM would make one
            ir, found = FunctionWriter(self.arithmetic), "poison"
            for lane in range(size):
                number = ir.value(f"load volatile double, ptr {ir.at('%x', lane)}, align 8")
                found = ir.value(f"insertelement {vector} {found}, double {number}, i32 {lane}")
            return ir.function(f"internal {vector} @gathered{size}(ptr %x) nounwind noinline", f"{vector} {found}")

        def text(ir: FunctionWriter, name: str) -> None:
            common, found = [f"%in{k}" for k in range(first)], [f"%in{first + k}" for k in range(len(inputs))]
            for k in same if in_vectors else ():  # a vector of equal numbers
                number = ir.spread(ir.load_at(found[k], "double"))
                found[k] = ir.room()
                ir.store_at(number, found[k])
            brought = {k: ir.room() for k in gathered if self.text(f"gathered{size}", gather)}
            end: str | int = count
            if asked and self.arithmetic.lanes == 1:  # from one to count
                number = ir.load_at(f"%in{first + len(inputs)}", "double")
                for relation, limit in (("ogt", "1.0"), ("olt", f"{count}.0")):
                    inside = ir.value(f"fcmp {relation} double {number}, {limit}")
                    number = ir.value(f"select i1 {inside}, double {number}, double {limit}")
                end = ir.value(f"fptosi double {number} to i64")
            with ir.loop(0, end, arithmetic.lanes if in_vectors else 1) as i:
                for k in gathered:
                    ir.store_at(ir.value(f"call {vector} @gathered{size}(ptr {ir.at(found[k], i, one)})"), brought[k])
                sources = [brought.get(k, at if k in same else ir.at(at, i, one)) for k, at in enumerate(found)]
                targets = [ir.at(f"%out{k}", i, one) for k in range(len(outputs))]
                x = [place for at, length in zip(common, shared, strict=True) for place in _places(one, at, 0, length)]
                for k, (at, length) in enumerate(zip(sources, inputs, strict=True)):
                    x += _places(one, at, 0, max(1, length // count), 0 if k in same else count)
                y = [p for at, n in zip(targets, outputs, strict=True) for p in _places(one, at, 0, n // count, count)]
                uniform = sum(shared) if in_vectors else 0
                self._body(ir, name, graph, {"x": x, "y": y}, [*common, *sources, *targets], uniform=uniform)

        key = ("map", id(graph), shared, inputs, outputs, count, tuple(gathered), asked)
        return self._define(key, "map", text, arithmetic, first + len(inputs) + asked, len(outputs))

    def row(self, graph: Graph, blocks: int, reads: Sequence[Lengths], writes: Sequence[Lengths]) -> str:
        """y = graph(x), where x and y end to end are so many numbers of some of the blocks, each a pointer."""
        t, pointers = self.arithmetic.type, [f"%in{k}" for k in range(blocks)]
        x, y = ([p for block, n in parts for p in _places(t, pointers[block], 0, n)] for parts in (reads, writes))

        def text(ir: FunctionWriter, name: str) -> None:
            self._body(ir, name, graph, {"x": x, "y": y}, pointers)

        return self._define(("row", id(graph), blocks, *reads, -1, *writes), "row", text, self.arithmetic, blocks, 0)

    def total(self, count: int) -> str:
        """y = x[0] + .. + x[count - 1], added up in this order from 0."""
        t = self.arithmetic.type

        def text(ir: FunctionWriter, _: str) -> None:
            if not count:
                ir.store_at(ir.number(0.0), "%out0")
                return
            with ir.loop(0, count) as i:  # the sum is in a register of the processor
                ir.line(f"{i}.sum = phi {t} [ {ir.number(0.0)}, %start ], [ {i}.total, %{i[1:]}.again ]")
                ir.line(f"{i}.total = fadd {t} {i}.sum, {ir.load_at(ir.at('%in0', i))}")
            ir.store_at(f"{i}.total", "%out0")

        return self._define(("total", count), "total", text, self.arithmetic, 1, 1)

    def take(self, table: Sequence[int], places: Sequence[int]) -> str:
        """y[places[i]] = x[table[i]]; places that are all, in order, are left out."""
        tables = [table] if tuple(places) == tuple(range(len(table))) else [table, places]

        def text(ir: FunctionWriter, name: str) -> None:
            for k, numbers in enumerate(tables):
                listed = ", ".join(f"i64 {each}" for each in numbers)
                self.definitions.append(f"@{name}.{k} = internal unnamed_addr constant [{len(table)} x i64] [{listed}]")
            with ir.loop(0, len(table)) as i:
                source, *target = [ir.load_at(ir.at(f"@{name}.{k}", i, "i64"), "i64") for k in range(len(tables))]
                ir.store_at(ir.load_at(ir.at("%in0", source)), ir.at("%out0", target[0] if target else i))

        return self._define(("take", *map(tuple, tables)), "take", text, self.arithmetic, 1, 1)

    def _body(self, ir: FunctionWriter, name: str, *graph: Any, **how: Any) -> None:
        """What computes a graph in a function of that name, see `write_graph`, behind what it calls."""
        for line in write_graph(ir, name, *graph, **how):
            quick = self.quick and line.startswith("define")
            self.definitions.append(line.replace("noinline {", "noinline optnone {") if quick else line)

    def _define(
        self, key: tuple[object, ...], kind: str, text: Text, arithmetic: Arithmetic, inputs: int, outputs: int
    ) -> str:
        """The name of the function of this key, which is written when it is first asked for."""
        key, how = (*key, self.quick), " noinline optnone" if self.quick else ""
        if key not in self._names:
            name = self._names[key] = f"{kind}{len(self._names)}"
            ir = FunctionWriter(arithmetic)
            text(ir, name)  # which may define functions of its own
            arguments = [f"%{side}{k}" for side, count in (("in", inputs), ("out", outputs)) for k in range(count)]
            listed = ", ".join([f"ptr noalias {argument}" for argument in arguments])
            self.definitions += ir.function(f"internal void @{name}({listed}) nounwind{how}")
        return self._names[key]

    def text(self, name: str, text: Callable[[Arithmetic], Sequence[str]]) -> str:
        """A function of that name, whose lines `text` writes for the module's arithmetic."""
        if (name,) not in self._names:
            self._names[name,] = name
            self.definitions += text(self.arithmetic)
        return name


def _places(t: str, pointer: str, begin: int, count: int, step: int = 1) -> list[str]:
    """Places of numbers of a register."""
    return [f"{t}, ptr {pointer}, i64 {begin + k * step}" for k in range(count)]


class Writer(FunctionWriter):
    """The statements of a function over registers, as LLVM's text.

    size: bytes of a number.  before: the statement written last.  offsets: {register: its place in %memory}, if there.
    alone: ids of graphs that one statement calls.
    """

    def __init__(self, registers: Registers, functions: Functions) -> None:
        super().__init__(functions.arithmetic)
        self.registers, self.functions, self.size = registers, functions, 8 * self.lanes
        self.pointers = {name: f"%r{number}" for number, name in enumerate(registers)}
        self.before: Statement | None = None
        self.offsets: Registers = {}
        self.alone: frozenset[int] = frozenset()

    def run(self, statements: Sequence[Statement]) -> None:
        """Statements, one after another."""
        for statement in statements:
            text = row_of(statement).text
            assert text is not None, "the runner has asked"
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

    def positive(self, register: str) -> str:
        """Whether register > 0, where NaN is not; of lanes, whether any is."""
        return self.some(self.compare("ogt", self.load(register), 0.0))

    def calls(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Call a function of registers; one that it also reads is written to scratch memory, and copied after."""
        beside = {output: self.beside(self.registers[output]) for output in outputs if output in inputs}
        self.call(name, [*map(self.pointer, inputs), *[beside.get(each) or self.pointer(each) for each in outputs]])
        for output, scratch in beside.items():
            self.copy_bytes(self.pointer(output), scratch, self.registers[output] * self.size)

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
