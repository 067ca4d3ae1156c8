"""LLVM's text for a batch: the graph on one vector of columns after another.

Points lie in columns, side by side, or in rows, one after another. The numbers of points in
columns lie far apart in a large batch, each in a page of memory of its own, often by a power of two, where few of them
fit in a cache at once. So where there are many, the inputs of some vectors, a tile, are brought together at a time, and
results go out together. Of points in rows, a block of as many numbers of as many points as a vector has lanes is a
square, which some shuffles transpose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..core.graph import Graph
from .function_writer import REGISTERS, Arithmetic, FunctionWriter
from .llvm_ir import instructions, preamble

MEMORY = 2**18  # bytes for inputs and outputs of a tile: a part of a core's second cache
VECTORS = 16  # in a tile, at most
FEW_PLACES = 48  # inputs and outputs that a cache holds wherever they lie


class Batch(NamedTuple):
    """A module with `void batch(double *x, double *y, int64_t n, int64_t x_stride, int64_t y_stride, double *w)`.

    Row i of x begins at x + i * x_stride, and likewise for y; n columns, a positive multiple of the lanes, are read.
    `rows` takes the same, the point i at x + i * x_stride.
    size: how many doubles w takes; it is aligned to a vector.
    """

    source: str
    size: int


class Place(NamedTuple):
    """Place of numbers in the memory w: `size` vectors, from the vector `start` on."""

    start: int
    size: int


_ARGUMENTS = "ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy, ptr noalias %w"


def batch_ir(graph: Graph, lanes: int, flags: str = "", registers: int = REGISTERS) -> Batch:
    """The module for a graph, in vectors of so many lanes."""
    arithmetic = Arithmetic(flags, lanes, registers)
    n_in, n_out = len(graph.inputs), len(graph.outputs)
    tiled = n_in + n_out > FEW_PLACES

    def address(base: str, name: str, row: int) -> list[str]:
        if tiled:
            return [f"  {name} = getelementptr {arithmetic.type}, ptr %{base}, i64 {row}"]
        return [
            f"  {name}.row = mul i64 %d{base}, {row}",
            f"  {name} = getelementptr double, ptr %{base}, i64 {name}.row",
        ]

    code = instructions(graph, arithmetic, address, "batch")
    lines = [*preamble([graph], arithmetic), *code.definitions]
    for number, part in enumerate(code.parts):
        how = f"nounwind noinline alignstack({8 * lanes})"
        head = f"define internal void @part{number}({_ARGUMENTS.replace(' i64 %n,', '')}) {how} {{"
        lines += [head, "start:", *code.start, *part, "  ret void", "}"]

    def compute(ir: FunctionWriter, x: str, y: str, dx: str | int = lanes, dy: str | int = lanes) -> None:
        for number in range(len(code.parts)):
            ir.line(f"call void @part{number}(ptr {x}, ptr {y}, i64 {dx}, i64 {dy}, ptr %w)")

    vectors = max(1, min(VECTORS, MEMORY // (8 * lanes * max(1, n_in + n_out)))) if tiled else 0
    lines += rows_ir(arithmetic, Place(code.places, n_in), [Place(code.places + n_in, n_out)], compute)
    ir = FunctionWriter(arithmetic)
    with ir.loop(0, "%n", max(1, vectors) * lanes) as i:
        x, y = (ir.at(base, i, "double") for base in ("%x", "%y"))
        if tiled:
            points = ir.at("%w", code.places)
            results = ir.at(points, n_in * vectors)
            left = ir.integer("sub", "%n", i)
            few = ir.integer("icmp slt", left, vectors * lanes)
            count = ir.integer("udiv", ir.value(f"select i1 {few}, i64 {left}, i64 {vectors * lanes}"), lanes)
            ir.line(_COPY_CALL.format(x, points, n_in, count, "%dx", lanes, lanes, n_in * lanes))
            with ir.loop(0, count) as k:
                compute(ir, ir.at(points, ir.integer("mul", k, n_in)), ir.at(results, ir.integer("mul", k, n_out)))
            ir.line(_COPY_CALL.format(results, y, n_out, count, lanes, n_out * lanes, "%dy", lanes))
        else:
            compute(ir, x, y, "%dx", "%dy")
    lines += [*_copy(arithmetic), *ir.function(f"void @batch({_ARGUMENTS}) nounwind")]
    return Batch("\n".join([*lines, ""]), lanes * (code.places + max(1, vectors) * (n_in + n_out)))


_COPY = "ptr noalias %from, ptr noalias %to, i64 %rows, i64 %count, "
_COPY += "i64 %from.row, i64 %from.vector, i64 %to.row, i64 %to.vector"
_COPY_CALL = "call void @copy(ptr {}, ptr {}, i64 {}, i64 {}, i64 {}, i64 {}, i64 {}, i64 {})"


def _copy(arithmetic: Arithmetic) -> list[str]:
    """to[row * to.row + k * to.vector] = from[row * from.row + k * from.vector], a vector each, for k < count."""
    ir = FunctionWriter(arithmetic)
    with ir.loop(0, "%rows") as row:
        a, b = (ir.at(f"%{end}", ir.integer("mul", row, f"%{end}.row"), "double") for end in ("from", "to"))
        with ir.loop(0, "%count") as k:
            source = ir.at(a, ir.integer("mul", k, "%from.vector"), "double")
            target = ir.at(b, ir.integer("mul", k, "%to.vector"), "double")
            ir.store_at(ir.load_at(source), target)
    return ir.function(f"internal void @copy({_COPY}) nounwind noinline")


def rows_ir(
    arithmetic: Arithmetic,
    points: Place,
    results: Sequence[Place],
    compute: Callable[[FunctionWriter, str, str], None],
) -> list[str]:
    """`void rows(double *x, double *y, int64_t n, int64_t dx, int64_t dy, double *w)`; point i begins at x + i dx.

    compute: writes what computes results of points, from the addresses of their vectors, those of the first results;
    end to end they are a row of y.
    """
    ir = FunctionWriter(arithmetic)
    sources = ir.at("%w", points.start), *[ir.at("%w", place.start) for place in results]
    with ir.loop(0, "%n", arithmetic.lanes) as i:
        x, y = (ir.at(f"%{base}", ir.integer("mul", i, f"%d{base}"), "double") for base in "xy")
        ir.line(f"call void @gather(ptr {x}, ptr {sources[0]}, i64 %dx)")
        compute(ir, sources[0], sources[1] if results else "null")
        column = 0
        for place, source in zip(results, sources[1:], strict=True):
            ir.line(f"call void @scatter{place.size}(ptr {ir.at(y, column, 'double')}, ptr {source}, i64 %dy)")
            column += place.size
    return [
        *_mover("gather", points.size, arithmetic, filling=True),
        *[
            line
            for count in sorted({place.size for place in results})
            for line in _mover(f"scatter{count}", count, arithmetic, filling=False)
        ],
        *ir.function(f"void @rows({_ARGUMENTS}) nounwind"),
    ]


def _mover(name: str, count: int, arithmetic: Arithmetic, *, filling: bool) -> list[str]:
    """The function that fills `count` vectors from rows, d doubles apart, of as many points as there are lanes.

    filling: this way, else from vectors to rows. The last block begins where it ends with the row, in the one before.
    """
    ir, lanes = FunctionWriter(arithmetic), arithmetic.lanes
    rows = [ir.at("%rows", ir.integer("mul", "%d", k), "double") for k in range(lanes)]
    if count < lanes:  # number by number
        for k, r in [(k, r) for k in range(lanes) for r in range(count)]:
            ends = ir.at(rows[k], r, "double"), ir.at("%vectors", r * lanes + k, "double")
            source, target = ends if filling else ends[::-1]
            ir.store_at(ir.load_at(source, "double"), target, "double")
    else:
        with ir.loop(0, count, lanes) as i:
            far = ir.integer("icmp sgt", i, count - lanes)
            _transpose(ir, rows, ir.value(f"select i1 {far}, i64 {count - lanes}, i64 {i}"), filling)
    return ir.function(f"internal void @{name}(ptr noalias %rows, ptr noalias %vectors, i64 %d) nounwind noinline")


def _transpose(ir: FunctionWriter, rows: Sequence[str], r: str, filling: bool) -> None:
    """One square: what begins in column r of the rows, as vectors r and on, or back."""
    lanes, t = ir.lanes, ir.type
    first = ir.at("%vectors", r)
    ends = [ir.at(row, r, "double") for row in rows], [ir.at(first, k) for k in range(lanes)]
    sources, targets = ends if filling else ends[::-1]
    numbers, distance = [ir.load_at(source) for source in sources], 1
    while distance < lanes:  # blocks of 2, 4, .. rows and columns, of which the off-diagonal halves change places
        shuffled = []
        for i in range(lanes):
            mask = ", ".join([f"i32 {_taken(i, lane, distance, lanes)}" for lane in range(lanes)])
            pair = f"{t} {numbers[i & ~distance]}, {t} {numbers[i | distance]}"
            shuffled.append(ir.value(f"shufflevector {pair}, <{lanes} x i32> <{mask}>"))
        numbers, distance = shuffled, 2 * distance
    for number, target in zip(numbers, targets, strict=True):
        ir.store_at(number, target)


def _taken(row: int, lane: int, distance: int, lanes: int) -> int:
    """Lane of two rows, the one with this bit clear first, that goes to a lane of a row."""
    return (lane & ~distance | (row & distance)) + (lanes if lane & distance else 0)
