"""LLVM's text for a graph: straight lines, an instruction or a few for each node, over floats or over vector lanes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import CONSTANT, VARIABLE, Node
from .schedule import Joined, joined_calls, schedule
from .vector_math import helpers

BLOCK = 1024  # nodes in a basic block: some of LLVM's passes cost more than proportionally in the length of one
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
    lines = ["define void @point(ptr noalias %x, ptr noalias %y) nounwind {", "start:"]
    lines += body(graph, arithmetic, _element)
    return "\n".join([*preamble([graph], arithmetic), *lines, "  ret void", "}", ""])


def _element(base: str, name: str, row: int) -> list[str]:
    return [f"  {name} = getelementptr double, ptr %{base}, i64 {row}"]


def batch_ir(graph: Graph, lanes: int, flags: str = "") -> str:
    """A module with `void batch(double *x, double *y, int64_t n, int64_t x_stride, int64_t y_stride)`.

    Row i of x begins at x + i * x_stride, and likewise for y; n columns, a positive multiple of `lanes`, are read.
    """
    arithmetic = Arithmetic(flags, lanes)
    lines = [
        "define void @batch(ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy) nounwind {",
        "start:",
        "  br label %columns",
        "columns:",
        "  %i = phi i64 [ 0, %start ], [ %next, %last ]",
        *body(graph, arithmetic, _row),
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


def body(graph: Graph, arithmetic: Arithmetic, address: Address) -> list[str]:
    """Every node in the order of `schedule`; an output is stored as soon as it is known."""
    words, t = arithmetic.words(), arithmetic.type
    stored: dict[Node, list[int]] = {}
    for row, node in enumerate(graph.outputs.values()):
        stored.setdefault(node, []).append(row)
    rows = {node: row for row, node in enumerate(graph.inputs)}
    calls = _joined_calls(graph, arithmetic)
    prefix = f"lanes{arithmetic.lanes}." if arithmetic.lanes > 1 else ""
    names: dict[Node | Joined, str] = {}
    lines: list[str] = []

    for number, step in enumerate(schedule(graph, calls)):
        r = names[step] = f"%v{number}"
        if number and number % BLOCK == 0:
            lines += [f"  br label %block{number}", f"block{number}:"]
        if isinstance(step, Joined):
            lines += _call(step, r, [names[arg] for arg in step.arguments], arithmetic)
            continue
        node, args = step, [names[arg] for arg in step.args]
        if node.op is CONSTANT:
            assert node.value is not None
            names[node] = arithmetic.number(node.value)
        elif node.op is VARIABLE:
            lines += address("x", f"%x{number}", rows[node])
            lines.append(f"  {r} = load {t}, ptr %x{number}, align 8")
        elif node.op.llvm:
            call = f"@{prefix}{node.op.library}"
            lines += [f"  {line.format(*args, r=r, call=call, **words)}" for line in node.op.llvm]
        elif node in calls:
            names[node], more = _result(node, calls[node], r, names[calls[node]], arithmetic)
            lines += more
        else:
            lines.append(f"  {r} = call {t} @{prefix}{node.op.library}({', '.join(f'{t} {arg}' for arg in args)})")
        for row in stored.get(node, ()):
            lines += address("y", f"%y{row}", row)
            lines.append(f"  store {t} {names[node]}, ptr %y{row}, align 8")
    return lines


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
