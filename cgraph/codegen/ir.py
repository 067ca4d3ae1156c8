"""LLVM's text for a graph: straight lines, an instruction or a few for each node, over floats or over vector lanes."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..graph import Graph
from ..node import CONSTANT, VARIABLE, Node
from .lanes import helpers

BLOCK = 1024  # nodes in a basic block: some of LLVM's passes cost more than proportionally in the length of one

# An instruction or a few for each operation that needs no library: {r} result, {0} {1} {2} arguments, {t} type, {b}
# type of a comparison, {f} flags, {s} suffix of an intrinsic, {zero} {one} {minus} constants.
# Others are libm's, by name.
INLINE = {
    "add": ("{r} = fadd {f}{t} {0}, {1}",),
    "sub": ("{r} = fsub {f}{t} {0}, {1}",),
    "mul": ("{r} = fmul {f}{t} {0}, {1}",),
    "div": ("{r} = fdiv {f}{t} {0}, {1}",),
    "neg": ("{r} = fneg {t} {0}",),
    "abs": ("{r} = call {t} @llvm.fabs.{s}({t} {0})",),
    "sqrt": ("{r} = call {t} @llvm.sqrt.{s}({t} {0})",),
    "sign": (
        "{r}.above = fcmp ogt {t} {0}, {zero}",
        "{r}.below = fcmp olt {t} {0}, {zero}",
        "{r}.nan = fcmp uno {t} {0}, {zero}",
        "{r}.up = select {b} {r}.above, {t} {one}, {t} {zero}",
        "{r}.down = select {b} {r}.below, {t} {minus}, {t} {r}.up",
        "{r} = select {b} {r}.nan, {t} {0}, {t} {r}.down",
    ),
    "minimum": (
        "{r}.nan = fcmp uno {t} {0}, {zero}",
        "{r}.less = fcmp ole {t} {0}, {1}",
        "{r}.first = or {b} {r}.nan, {r}.less",
        "{r} = select {b} {r}.first, {t} {0}, {t} {1}",
    ),
    "maximum": (
        "{r}.nan = fcmp uno {t} {0}, {zero}",
        "{r}.more = fcmp oge {t} {0}, {1}",
        "{r}.first = or {b} {r}.nan, {r}.more",
        "{r} = select {b} {r}.first, {t} {0}, {t} {1}",
    ),
    "less": ("{r}.is = fcmp olt {t} {0}, {1}", "{r} = select {b} {r}.is, {t} {one}, {t} {zero}"),
    "less_equal": ("{r}.is = fcmp ole {t} {0}, {1}", "{r} = select {b} {r}.is, {t} {one}, {t} {zero}"),
    "equal": ("{r}.is = fcmp oeq {t} {0}, {1}", "{r} = select {b} {r}.is, {t} {one}, {t} {zero}"),
    "not_equal": ("{r}.is = fcmp une {t} {0}, {1}", "{r} = select {b} {r}.is, {t} {one}, {t} {zero}"),
    "where": ("{r}.is = fcmp une {t} {0}, {zero}", "{r} = select {b} {r}.is, {t} {1}, {t} {2}"),
    "strong_mul": (
        "{r}.a = fcmp une {t} {0}, {zero}",
        "{r}.b = fcmp une {t} {1}, {zero}",
        "{r}.both = and {b} {r}.a, {r}.b",
        "{r}.product = fmul {f}{t} {0}, {1}",
        "{r} = select {b} {r}.both, {t} {r}.product, {t} {zero}",
    ),
}


# Lines that compute, under a name, the address of row k of the inputs ("x") or outputs ("y"): (base, name, k) -> lines
Address = Callable[[str, str, int], list[str]]


class Arithmetic(NamedTuple):
    """What the instructions of a function may do, and on how many numbers at once."""

    flags: str = ""  # fast-math flags of add, sub, mul and div: none is strict IEEE
    lanes: int = 1  # doubles in a vector

    @property
    def type(self) -> str:
        """The type of a value."""
        return "double" if self.lanes == 1 else f"<{self.lanes} x double>"

    def words(self) -> dict[str, str]:
        """What the templates of `INLINE` name."""
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
    calls = {n.op.name: n.op.arity for n in graph.nodes if n.op is not CONSTANT and n.op is not VARIABLE}
    return {name: arity for name, arity in sorted(calls.items()) if name not in INLINE}


def scalar_ir(graph: Graph, flags: str = "") -> str:
    """A module with `void point(double *x, double *y)`: the outputs y at the inputs x."""
    lines = ["define void @point(ptr noalias %x, ptr noalias %y) nounwind {", "start:"]
    lines += body(graph, Arithmetic(flags), _element)
    return "\n".join([*declarations(libm_functions(graph)), *lines, "  ret void", "}", ""])


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
    functions = libm_functions(graph)
    return "\n".join([*declarations(functions), *helpers(functions, lanes, flags), *lines, ""])


def _row(base: str, name: str, row: int) -> list[str]:
    return [
        f"  {name}.row = mul i64 %d{base}, {row}",
        f"  {name}.at = add i64 {name}.row, %i",
        f"  {name} = getelementptr double, ptr %{base}, i64 {name}.at",
    ]


def declarations(functions: Mapping[str, int]) -> list[str]:
    """The functions of the C library, {name: number of arguments}, as the module has to declare them."""
    # nobuiltin: LLVM would make pow(x, 2) into x * x, which differs in the last bit. Nobody reads errno.
    return [
        f"declare double @{name}({', '.join(['double'] * arity)}) nounwind willreturn memory(none) nobuiltin"
        for name, arity in functions.items()
    ]


def body(graph: Graph, arithmetic: Arithmetic, address: Address) -> list[str]:
    """Every node in order; an output is stored as soon as it is known, so that few values are alive at once."""
    words, t = arithmetic.words(), arithmetic.type
    stored: dict[Node, list[int]] = {}
    for row, node in enumerate(graph.outputs.values()):
        stored.setdefault(node, []).append(row)
    rows = {node: row for row, node in enumerate(graph.inputs)}
    paired = _paired(graph) if arithmetic.lanes > 1 else set()
    pairs: dict[Node, str] = {}
    lines: list[str] = []

    names: dict[Node, str] = {}

    for number, node in enumerate(graph.nodes):
        r = f"%v{number}"
        if number and number % BLOCK == 0:
            lines += [f"  br label %block{number}", f"block{number}:"]
        if node.op is CONSTANT:
            assert node.value is not None
            names[node] = arithmetic.number(node.value)
        else:
            names[node] = r
            args = [names[arg] for arg in node.args]
            if node.op is VARIABLE:
                lines += address("x", f"%x{number}", rows[node])
                lines.append(f"  {r} = load {t}, ptr %x{number}, align 8")
            elif node.op.name in INLINE:
                lines += [f"  {line.format(*args, r=r, **words)}" for line in INLINE[node.op.name]]
            elif node.args[0] in paired and node.op.name in ("sin", "cos"):
                angle = node.args[0]  # both are needed: one reduction of the angle serves them
                if angle not in pairs:
                    pairs[angle] = f"{r}.both"
                    lines.append(f"  {r}.both = call {{{t}, {t}}} @lanes.sincos({t} {args[0]})")
                slot = 0 if node.op.name == "sin" else 1
                lines.append(f"  {r} = extractvalue {{{t}, {t}}} {pairs[angle]}, {slot}")
            else:
                prefix = "lanes." if arithmetic.lanes > 1 else ""
                lines.append(f"  {r} = call {t} @{prefix}{node.op.name}({', '.join(f'{t} {arg}' for arg in args)})")
        for row in stored.get(node, ()):
            lines += address("y", f"%y{row}", row)
            lines.append(f"  store {t} {names[node]}, ptr %y{row}, align 8")
    return lines


def _paired(graph: Graph) -> set[Node]:
    """Nodes of which the graph takes the sine and the cosine."""
    taken: dict[str, set[Node]] = {"sin": set(), "cos": set()}
    for node in graph.nodes:
        if node.op.name in taken:
            taken[node.op.name].add(node.args[0])
    return taken["sin"] & taken["cos"]
