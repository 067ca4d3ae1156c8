"""LLVM's text for a graph: straight lines, an instruction or a few for each node, over floats or over vector lanes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from .parts import Parts
from .schedule import Joined, joined_calls, needed, schedule
from .vector_math import helpers

TOGETHER = 4  # arguments in a joined call at one point: a vector of them is one register or two on every processor

# Lines that compute, under a name, the address of row k of the inputs ("x") or outputs ("y"): (base, name, k) -> lines
Address = Callable[[str, str, int], list[str]]


class Arithmetic(NamedTuple):
    """What the instructions of a function may do, and on how many numbers at once."""

    flags: str = ""  # fast-math flags of add, sub, mul and div: none is strict IEEE
    lanes: int = 1  # doubles in a vector
    together: int = 1  # at most so many arguments go into one call of a vector function, where lanes is 1

    @property
    def polynomials(self) -> bool:
        """Whether vectors have sines, exponentials, .. from polynomials; strict IEEE has libm's bits everywhere."""
        return bool(self.flags)

    @property
    def type(self) -> str:
        """The type of a value."""
        return "double" if self.lanes == 1 else f"<{self.lanes} x double>"

    def words(self) -> dict[str, str]:
        """What the column `llvm` of the operation table names."""
        return {
            "t": self.type,
            "b": "i1" if self.lanes == 1 else f"<{self.lanes} x i1>",
            "s": "f64" if self.lanes == 1 else f"v{self.lanes}f64",
            "f": f"{self.flags} " if self.flags else "",
            "zero": self.number(0.0),
            "one": self.number(1.0),
            "minus": self.number(-1.0),
        }

    def number(self, value: float) -> str:
        """The constant, to the last bit."""
        bits = f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"
        return bits if self.lanes == 1 else f"splat (double {bits})"


def libm_functions(graph: Graph) -> dict[str, int]:
    """The functions of the C library that the graph calls, and how many arguments each takes."""
    calls = {node.op.library: node.op.arity for node in graph.nodes if node.args and node.op.calls_library}
    return dict(sorted(calls.items()))


def point_arithmetic(flags: str) -> Arithmetic:
    """One point at a time."""
    return Arithmetic(flags, together=TOGETHER)


def scalar_ir(graph: Graph, flags: str = "") -> str:
    """A module with `void point(double *x, double *y)`: the outputs y at the inputs x."""
    arithmetic = point_arithmetic(flags)
    written = body(graph, arithmetic, _element, "point", ["ptr %x", "ptr %y"])
    lines = [*preamble([graph], arithmetic), *written.functions]
    lines += ["define void @point(ptr noalias %x, ptr noalias %y) nounwind {", "start:"]
    return "\n".join([*lines, *written.start, *written.lines, "  ret void", "}", ""])


def _element(base: str, name: str, row: int) -> list[str]:
    return [f"  {name} = getelementptr double, ptr %{base}, i64 {row}"]


def batch_ir(graph: Graph, lanes: int, flags: str = "") -> str:
    """A module with `void batch(double *x, double *y, int64_t n, int64_t x_stride, int64_t y_stride)`.

    Row i of x begins at x + i * x_stride, and likewise for y; n columns, a positive multiple of `lanes`, are read.
    """
    arithmetic = Arithmetic(flags, lanes)
    written = body(graph, arithmetic, _row, "batch", ["ptr %x", "ptr %y", "i64 %dx", "i64 %dy", "i64 %i"])
    lines = [
        *written.functions,
        "define void @batch(ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy) nounwind {",
        "start:",
        *written.start,
        "  br label %columns",
        "columns:",
        "  %i = phi i64 [ 0, %start ], [ %next, %last ]",
        *written.lines,
        "  br label %last",
        "last:",
        f"  %next = add i64 %i, {lanes}",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %columns, label %end",
        "end:",
        "  ret void",
        "}",
    ]
    return "\n".join([*preamble([graph], arithmetic), *lines, ""])


def _row(base: str, name: str, row: int) -> list[str]:
    return [
        f"  {name}.row = mul i64 %d{base}, {row}",
        f"  {name}.at = add i64 {name}.row, %i",
        f"  {name} = getelementptr double, ptr %{base}, i64 {name}.at",
    ]


def preamble(graphs: Iterable[Graph], arithmetic: Arithmetic) -> list[str]:
    """What a module needs before the bodies of these graphs: functions of the C library, and those on vectors."""
    libm: dict[str, int] = {}
    called: dict[str, int] = {}
    for graph in graphs:
        libm |= libm_functions(graph)
        calls = _joined_calls(graph, arithmetic)
        called |= {"".join(call.names): 1 for call in calls.values()}
        if arithmetic.lanes > 1:
            alone = {node.op.library for node in graph.nodes if node not in calls}
            called |= {name: arity for name, arity in libm_functions(graph).items() if name in alone}
    vector = _vector(arithmetic)
    return [*declarations(libm), *helpers(called, vector.lanes, vector.flags, polynomials=vector.polynomials)]


def _joined_calls(graph: Graph, arithmetic: Arithmetic) -> dict[Node, Joined]:
    joined = arithmetic.polynomials and _vector(arithmetic).lanes > 1
    return joined_calls(graph, arithmetic.together) if joined else {}


def declarations(functions: Mapping[str, int]) -> list[str]:
    """The functions of the C library, {name: number of arguments}, as the module has to declare them."""
    # nobuiltin: LLVM would make pow(x, 2) into x * x, which differs in the last bit. Nobody reads errno.
    return [
        f"declare double @{name}({', '.join(['double'] * arity)}) nounwind willreturn memory(none) nobuiltin"
        for name, arity in functions.items()
    ]


class Body(NamedTuple):
    """The instructions that compute a graph.

    start: what stands once at the start of the function.  lines: the rest, which may be in a loop.
    functions: that they call, for a long graph.
    """

    start: list[str]
    lines: list[str]
    functions: list[str]


def body(
    graph: Graph, arithmetic: Arithmetic, address: Address, name: str, scope: Sequence[str], *, uniform: int = 0
) -> Body:
    """Every node in the order of `schedule`; an output is stored as soon as it is known.

    name: of the function.  scope: what the addresses are made from, each with its type.
    uniform: so many inputs, the first, are single numbers in memory, the same for all lanes.
    """
    words, t = arithmetic.words(), arithmetic.type
    stored: dict[Node, list[int]] = {}
    for row, node in enumerate(graph.outputs.values()):
        stored.setdefault(node, []).append(row)
    rows = {node: row for row, node in enumerate(graph.inputs)}
    calls = _joined_calls(graph, arithmetic)
    prefix = f"lanes{arithmetic.lanes}." if arithmetic.lanes > 1 else ""
    steps = schedule(graph, calls)
    parts = Parts(steps, calls, t, 8 * arithmetic.lanes)
    if parts.starts:
        steps = list(_results_behind_calls(steps, calls))
        parts = Parts(steps, calls, t, 8 * arithmetic.lanes)
    written: list[list[str]] = [[]]

    for number, step in enumerate(steps):
        r, lines = f"%v{number}", written[-1]
        if number in parts.starts:
            parts.begin()
            written.append(lines := [])
        args, loads = parts.read(needed(step, calls))
        lines += loads
        if isinstance(step, Joined):
            lines += _call(step, r, args, arithmetic)
        elif step.op is CONSTANT:
            assert step.value is not None
            r = arithmetic.number(step.value)
        elif step.op is VARIABLE:
            lines += address("x", f"%x{number}", rows[step])
            lines += _loaded(r, f"%x{number}", arithmetic, uniform=rows[step] < uniform)
        elif step in calls:
            r, more = _result(step, calls[step], r, args[0], arithmetic)
            lines += more
        elif step.op.llvm:
            call = f"@{prefix}{step.op.library}"
            lines += [f"  {line.format(*args, r=r, call=call, **words)}" for line in step.op.llvm]
        else:
            lines.append(f"  {r} = call {t} @{prefix}{step.op.library}({', '.join(f'{t} {arg}' for arg in args)})")
        lines += parts.write(number, step, r)
        for row in stored.get(step, ()) if isinstance(step, Node) else ():
            lines += address("y", f"%y{row}", row)
            lines.append(f"  store {t} {r}, ptr %y{row}, align 8")
    return _in_functions(written, name, scope, f"[{parts.places} x {t}]")


def _loaded(r: str, place: str, arithmetic: Arithmetic, *, uniform: bool) -> list[str]:
    """An input from memory: a value, or a number for all lanes."""
    t = arithmetic.type
    if not uniform or arithmetic.lanes == 1:
        return [f"  {r} = load {t}, ptr {place}, align 8"]
    return [
        f"  {r}.one = load double, ptr {place}, align 8",
        f"  {r}.first = insertelement {t} poison, double {r}.one, i32 0",
        f"  {r} = shufflevector {t} {r}.first, {t} poison, <{arithmetic.lanes} x i32> zeroinitializer",
    ]


def _in_functions(written: Sequence[list[str]], name: str, scope: Sequence[str], memory: str) -> Body:
    """The parts as functions, and their calls; one part stays as it is."""
    if len(written) == 1:
        return Body([], written[0], [])
    names = [f"@{name}.part{k}" for k in range(len(written))]
    values = [*scope, "ptr %w"]
    parameters = ", ".join([each.replace("ptr ", "ptr noalias ") for each in values])
    functions: list[str] = []
    for function, lines in zip(names, written, strict=True):
        functions += [f"define internal void {function}({parameters}) nounwind noinline {{", "start:"]
        functions += [*lines, "  ret void", "}"]
    calls = [f"  call void {function}({', '.join(values)})" for function in names]
    return Body([f"  %w = alloca {memory}, align 64"], calls, functions)


def _results_behind_calls(steps: Sequence[Node | Joined], calls: Mapping[Node, Joined]) -> Iterator[Node | Joined]:
    """The steps, the nodes that a joined call gives right behind it."""
    results: dict[Joined, list[Node]] = {}
    for node, call in calls.items():
        results.setdefault(call, []).append(node)
    for step in steps:
        if step not in calls:
            yield step
        if isinstance(step, Joined):
            yield from results[step]


def _vector(arithmetic: Arithmetic) -> Arithmetic:
    """Of a joined call: the lanes there are, or a vector filled with arguments."""
    return arithmetic._replace(lanes=max(arithmetic.lanes, arithmetic.together))


def _call(call: Joined, r: str, args: list[str], arithmetic: Arithmetic) -> list[str]:
    """The call. Single numbers are gathered in a vector for it; a lane left over holds 1, which suits every one."""
    vector = _vector(arithmetic)
    t, lines, argument = vector.type, [], args[0]
    if arithmetic.lanes == 1:
        argument = vector.number(1.0)
        for lane, arg in enumerate(args):
            lines.append(f"  {r}.in{lane} = insertelement {t} {argument}, double {arg}, i32 {lane}")
            argument = f"{r}.in{lane}"
    kind = t if len(call.names) == 1 else f"{{{t}, {t}}}"
    return [*lines, f"  {r} = call {kind} @lanes{vector.lanes}.{''.join(call.names)}({t} {argument})"]


def _result(node: Node, call: Joined, r: str, called: str, arithmetic: Arithmetic) -> tuple[str, list[str]]:
    """One node out of the results of its call: the value's name, and the lines that make it."""
    t, lines = _vector(arithmetic).type, []
    if len(call.names) > 1:
        lines.append(f"  {r}.all = extractvalue {{{t}, {t}}} {called}, {call.names.index(node.op.library)}")
        called = f"{r}.all"
    if arithmetic.lanes == 1:
        lines.append(f"  {r} = extractelement {t} {called}, i32 {call.arguments.index(node.args[0])}")
        called = r
    return called, lines
