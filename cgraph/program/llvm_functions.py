"""LLVM's text for the functions that a program's statements call: a graph once, element by element, or summed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..codegen.arithmetic import Arithmetic, words_of
from ..codegen.llvm_ir import Body, body, libm_functions
from ..core.graph import Graph
from ..core.node import Node

Lengths = tuple[int, ...]  # of the registers that are a function's arguments


class Functions:
    """The functions of one module, each written once.

    Every function takes pointers to registers, inputs first: `void f(in0, in1, .., out0, out1, ..)`.
    definitions: the lines of all functions.  width: of the vectors in which `map` goes through its elements.
    quick: whether what is defined is to be compiled in little time, for it seldom runs.
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
        *,
        exact: bool = False,
    ) -> str:
        """y = graph(x), where of its registers some, end to end, are x, and some y; a register may be both.

        products: see `instructions`.  exact: no product is joined with a sum.
        """
        t, arithmetic = self.arithmetic.type, self.arithmetic.unfused if exact else self.arithmetic
        places = [[f"{t}, ptr %in{k}, i64 {at}" for at in range(size)] for k, size in enumerate(registers)]
        x, y = ([place for k in which for place in places[k]] for which in (reads, writes))
        known = set(x)
        again = {row for row, place in enumerate(y) if place in known}

        def lines() -> list[str]:
            scope = _pointers("in", registers)
            written = self._body(graph, arithmetic, x, y, scope, products=products, last=again)
            return [*written.start, *written.lines]

        key = (id(graph), registers, tuple(reads), tuple(writes), exact)
        return self._define(key, "call", lines, len(registers), 0)

    def map(self, graph: Graph, inputs: Lengths, count: int, shared: Lengths = (), apart: Sequence[bool] = ()) -> str:
        """y[i] = graph(shared, x[i]) for i = 0 .. count - 1; an input of another length holds one number for all i.

        Where it can, a vector of elements at a time; results beyond the last one go to the register's padding.
        apart: the inputs whose numbers have just been written one by one, and so are read: one load of them all would
        wait until they are in the cache.
        """
        first, inputs = len(shared), (*shared, *inputs)
        in_vectors = self.arithmetic.lanes == 1 and self.width > 1 and count > 1 and not libm_functions(graph)
        arithmetic = self.arithmetic._replace(lanes=self.width, together=1) if in_vectors else self.arithmetic
        t, same = (
            arithmetic.type,
            [k for k, length in enumerate(inputs) if in_vectors and k >= first and length != count],
        )
        written = [first + k for k, each in enumerate(apart) if each and in_vectors and inputs[first + k] == count]
        scope = [*_pointers("in", inputs), *_pointers("out", graph.outputs), "i64 %i", *[f"ptr %same{k}" for k in same]]
        scope += [f"ptr %vector{k}" for k in written]

        def lines() -> list[str]:
            spread = []  # a vector of equal numbers for each input that is the same for all elements
            for k in same:
                spread += [f"  %same{k} = alloca {t}, align 64", f"  %one{k} = load double, ptr %in{k}, align 8"]
                spread += [*arithmetic.splat(f"%all{k}", f"%one{k}"), f"  store {t} %all{k}, ptr %same{k}, align 64"]
            x = self._elements(t, inputs, first, count, same)
            gathered: list[str] = []
            gather = f"gathered{min(count, arithmetic.lanes)}"
            if written:
                self.text(gather, lambda _: _gathered_text(t, gather, min(count, arithmetic.lanes)))
            for k in written:
                spread.append(f"  %vector{k} = alloca {t}, align 64")
                gathered += [
                    f"  %register{k} = getelementptr {t}, ptr %in{k}, i64 %i",
                    f"  %gathered{k} = call {t} @{gather}(ptr %register{k})",
                    f"  store {t} %gathered{k}, ptr %vector{k}, align 64",
                ]
                x[sum(shared) + k - first] = f"{t}, ptr %vector{k}, i64 0"
            y = [f"{t}, ptr %out{k}, i64 %i" for k in range(len(graph.outputs))]
            body = self._body(graph, arithmetic, x, y, scope, uniform=sum(shared) if in_vectors else 0)
            body = body._replace(lines=[*gathered, *body.lines])
            return [*spread, *_loop(body, [], -(-count // arithmetic.lanes) if in_vectors else count)]

        key = ("map", id(graph), inputs, count, first, tuple(written))
        return self._define(key, "map", lines, len(inputs), len(graph.outputs))

    def _elements(self, t: str, inputs: Lengths, shared: int, count: int, same: Sequence[int] = ()) -> list[str]:
        """Places of the inputs of element %i: what all share, end to end, then one number of each other register."""
        places = _end_to_end(self.arithmetic.type, "in", inputs[:shared])
        for k, length in list(enumerate(inputs))[shared:]:
            own = f"ptr %in{k}, i64 {'%i' if length == count else 0}"
            places.append(f"{t}, {f'ptr %same{k}, i64 0' if k in same else own}")
        return places

    def tiled_map(
        self, graph: Graph, shared: Lengths, inputs: Lengths, outputs: Lengths, lanes: int, count: int, some: bool
    ) -> str:
        """y = graph(shared, x) of every tile, each number a vector; of every element, where that would not do.

        So it is with memories side by side, which are vectors themselves, and with functions of the C library.
        inputs, outputs: the numbers of an element in each register.  some: the last input says how many of `count`.
        """
        in_vectors = self.arithmetic.lanes == 1 and not libm_functions(graph)
        arithmetic = self.arithmetic._replace(lanes=lanes, together=1) if in_vectors else self.arithmetic
        t, step = arithmetic.type, 1 if in_vectors else lanes
        among = some and self.arithmetic.lanes > 1  # each memory has a number of tiles of its own
        scope = [*_pointers("in", shared), *_pointers("from", inputs), *_pointers("to", outputs)]
        scope += ["ptr %results"] if among else []

        def lines() -> list[str]:
            x = [*_end_to_end(self.arithmetic.type, "in", shared), *_end_to_end(t, "from", inputs, step)]
            y = _end_to_end(t, "to", outputs, step)
            results = [f"{t}, ptr %results, i64 {k}" for k in range(len(y))] if among else y
            written = self._body(graph, arithmetic, x, results, scope, uniform=sum(shared) if in_vectors else 0)
            here = [f"  %tile = udiv i64 %i, {step}", f"  %lane = urem i64 %i, {step}"] if step > 1 else []
            elements = [("from", k, size, f"%in{len(shared) + k}") for k, size in enumerate(inputs)]
            for name, k, size, register in (
                *elements,
                *[("to", k, size, f"%out{k}") for k, size in enumerate(outputs)],
            ):
                at = f"%{name}{k}.at"
                if step > 1:
                    here += [f"  {at}.tile = mul i64 %tile, {size * step}", f"  {at} = add i64 {at}.tile, %lane"]
                else:
                    here.append(f"  {at} = mul i64 %i, {size}")
                here.append(f"  %{name}{k} = getelementptr {t}, ptr {register}, i64 {at}")
            start = _tiles_text(self.arithmetic, count, f"%in{len(shared) + len(inputs)}", step) if some else []
            start += [f"  %results = alloca {t}, i64 {len(y)}, align 64"] if among else []
            after = _among_text(self.arithmetic, results, y, step) if among else []
            body = written._replace(start=[*start, *written.start], lines=[*here, *written.lines])
            return _loop(body, after, "%steps" if some else count * step)

        key = ("tiles", id(graph), shared, inputs, outputs, lanes, count, some)
        return self._define(key, "tiles", lines, len(shared) + len(inputs) + some, len(outputs))

    def total(self, count: int) -> str:
        """y = x[0] + .. + x[count - 1], added up in this order from 0."""
        t = self.arithmetic.type
        lines = ["  br label %each", "each:", "  %i = phi i64 [ 0, %start ], [ %next, %more ]"]
        lines += [
            f"  %sum = phi {t} [ {self.arithmetic.number(0.0)}, %start ], [ %total, %more ]",
            f"  %going = icmp slt i64 %i, {count}",
            "  br i1 %going, label %more, label %end",
            "more:",
            f"  %at = getelementptr {t}, ptr %in0, i64 %i",
            f"  %here = load {t}, ptr %at, align 8",
            f"  %total = fadd {t} %sum, %here",
            "  %next = add i64 %i, 1",
            "  br label %each",
            "end:",
            f"  store {t} %sum, ptr %out0, align 8",
        ]
        return self._define(("total", count), "total", lambda: lines, 1, 1)

    def take(self, table: Sequence[int], places: Sequence[int] = ()) -> str:
        """y[i] = x[table[i]], or y[places[i]]; where these are all, in order, they are left out."""
        t, size = self.arithmetic.type, len(table)
        places = () if tuple(places) == tuple(range(size)) else places

        def number(kind: str, numbers: Sequence[int]) -> list[str]:
            name, text = f"@{kind}{len(self._names)}", ", ".join(f"i64 {each}" for each in numbers)
            self.definitions.append(f"{name} = internal unnamed_addr constant [{size} x i64] [{text}]")
            return [
                f"  %{kind}.at = getelementptr i64, ptr {name}, i64 %i",
                f"  %{kind} = load i64, ptr %{kind}.at, align 8",
            ]

        def lines() -> list[str]:
            body = [
                *number("table", table),
                *(number("place", places) if places else []),
                f"  %from = getelementptr {t}, ptr %in0, i64 %table",
                f"  %to = getelementptr {t}, ptr %out0, i64 {'%place' if places else '%i'}",
                f"  %taken = load {t}, ptr %from, align 8",
                f"  store {t} %taken, ptr %to, align 8",
            ]
            return _loop(Body([], body, []), [], size) if size else []

        return self._define(("take", tuple(table), tuple(places)), "take", lines, 1, 1)

    def _body(
        self,
        graph: Graph,
        arithmetic: Arithmetic,
        x: Sequence[str],
        y: Sequence[str],
        scope: Sequence[str],
        **how: Any,
    ) -> Body:
        """The body of the function that is being defined, those that it calls defined before.

        x, y: where the inputs and outputs are: type, pointer, index.  how: see `instructions`.
        """

        def address(base: str, name: str, row: int) -> list[str]:
            return [f"  {name} = getelementptr {(x if base == 'x' else y)[row]}"]

        name = next(reversed(self._names.values()))
        written = body(graph, arithmetic, address, name, scope, **how)
        for line in written.definitions:
            quick = self.quick and line.startswith("define")
            self.definitions.append(line.replace("noinline {", "noinline optnone {") if quick else line)
        return written

    def _define(
        self, key: tuple[object, ...], kind: str, lines: Callable[[], list[str]], inputs: int, outputs: int
    ) -> str:
        """The name of the function of this key, which is written when it is first asked for."""
        key, how = (*key, self.quick), " noinline optnone" if self.quick else ""
        if key not in self._names:
            name = self._names[key] = f"{kind}{len(self._names)}"
            arguments = [*(f"ptr noalias %in{k}" for k in range(inputs))]
            arguments += [f"ptr noalias %out{k}" for k in range(outputs)]
            head = f"define internal void @{name}({', '.join(arguments)}) nounwind{how} {{"
            inner = lines()  # which may define functions of its own
            self.definitions += [head, "start:", *inner, "  ret void", "}"]
        return self._names[key]

    def text(self, name: str, text: Callable[[Arithmetic], Sequence[str]]) -> str:
        """A function of that name, whose lines `text` writes for the module's arithmetic."""
        if (name,) not in self._names:
            self._names[name,] = name
            self.definitions += text(self.arithmetic)
        return name


def _tiles_text(arithmetic: Arithmetic, count: int, register: str, step: int) -> list[str]:
    """%steps: `step` times the tiles that a register asks for, from one to `count`; of memories, the most."""
    t, bits, one, most = arithmetic.type, words_of(arithmetic)["b"], arithmetic.number(1.0), arithmetic.number(count)
    lines = [
        f"  %asked = load {t}, ptr {register}, align 8",
        f"  %several = fcmp ogt {t} %asked, {one}",
        f"  %least = select {bits} %several, {t} %asked, {t} {one}",
        f"  %fits = fcmp olt {t} %least, {most}",
        f"  %tiles = select {bits} %fits, {t} %least, {t} {most}",
    ]
    if arithmetic.lanes > 1:
        lines.append(f"  %most = call double @llvm.vector.reduce.fmax.{arithmetic.suffix}({t} %tiles)")
    whole = f"  %whole = fptosi double {'%most' if arithmetic.lanes > 1 else '%tiles'} to i64"
    return [*lines, whole, f"  %steps = mul i64 %whole, {step}"]


def _among_text(arithmetic: Arithmetic, results: Sequence[str], targets: Sequence[str], step: int) -> list[str]:
    """The results of an element among its numbers, in memories that ask for its tile."""
    t, bits = arithmetic.type, words_of(arithmetic)["b"]
    lines = [
        f"  %tile.next = add i64 {'%tile' if step > 1 else '%i'}, 1",
        "  %number = uitofp i64 %tile.next to double",
    ]
    lines += [*arithmetic.splat("%numbers", "%number"), f"  %asks = fcmp ole {t} %numbers, %tiles"]
    for row, (result, target) in enumerate(zip(results, targets, strict=True)):
        lines += [
            f"  %new{row}.at = getelementptr {result}",
            f"  %old{row}.at = getelementptr {target}",
            f"  %new{row} = load {t}, ptr %new{row}.at, align 8",
            f"  %old{row} = load {t}, ptr %old{row}.at, align 8",
            f"  %put{row} = select {bits} %asks, {t} %new{row}, {t} %old{row}",
            f"  store {t} %put{row}, ptr %old{row}.at, align 8",
        ]
    return lines


def _end_to_end(t: str, name: str, lengths: Lengths, step: int = 1) -> list[str]:
    """Places of the numbers of registers, end to end, each so many numbers behind the one before."""
    return [f"{t}, ptr %{name}{k}, i64 {at * step}" for k, length in enumerate(lengths) for at in range(length)]


def _gathered_text(t: str, name: str, size: int) -> list[str]:
    """The function `name(x)`: the vector of x[0], .., x[size - 1], by a load for each, of which LLVM would make one."""
    lines, vector = [f"define internal {t} @{name}(ptr %x) nounwind noinline {{"], "poison"
    for lane in range(size):
        lines += [
            f"  %x{lane}.at = getelementptr double, ptr %x, i64 {lane}",
            f"  %x{lane} = load volatile double, ptr %x{lane}.at, align 8",
            f"  %vector{lane} = insertelement {t} {vector}, double %x{lane}, i32 {lane}",
        ]
        vector = f"%vector{lane}"
    return [*lines, f"  ret {t} {vector}", "}"]


def _pointers(name: str, registers: Iterable[object]) -> list[str]:
    return [f"ptr %{name}{k}" for k, _ in enumerate(registers)]


def _loop(written: Body, after: list[str], count: int | str) -> list[str]:
    """The body, which may hold blocks, and the lines after it for %i = 0 .. count - 1."""
    return [
        *written.start,
        "  br label %each",
        "each:",
        "  %i = phi i64 [ 0, %start ], [ %next, %last ]",
        *written.lines,
        "  br label %last",
        "last:",
        *after,
        "  %next = add i64 %i, 1",
        f"  %more = icmp slt i64 %next, {count}",
        "  br i1 %more, label %each, label %end",
        "end:",
    ]
