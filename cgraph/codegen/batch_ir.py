"""LLVM's text for a batch: the graph on one vector of columns after another.

Points lie in columns, side by side, or in rows, one after another. The numbers of points in
columns lie far apart in a large batch, each in a page of memory of its own, often by a power of two, where few of them
fit in a cache at once. So where there are many, the inputs of some vectors, a tile, are brought together at a time, and
results go out together. Of points in rows, a block of as many numbers of as many points as a vector has lanes is a
square, which some shuffles transpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..core.graph import Graph
from .arithmetic import REGISTERS, Arithmetic
from .llvm_ir import instructions, preamble

MEMORY = 2**18  # bytes for inputs and outputs of a tile: a part of a core's second cache
VECTORS = 16  # in a tile, at most
FEW = 48  # inputs and outputs that a cache holds wherever they lie


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


def batch_ir(graph: Graph, lanes: int, flags: str = "", registers: int = REGISTERS) -> Batch:
    """The module for a graph, in vectors of so many lanes."""
    arithmetic = Arithmetic(flags, lanes, registers)
    n_in, n_out = len(graph.inputs), len(graph.outputs)

    tiled = n_in + n_out > FEW

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
        lines += [_PART.format(number=number, bytes=8 * lanes), *code.start, *part, "  ret void", "}"]
    vectors = max(1, min(VECTORS, MEMORY // (8 * lanes * max(1, n_in + n_out)))) if tiled else 0
    text = (_TILED if tiled else _DIRECT).format(
        t=arithmetic.type,
        lanes=lanes,
        columns=vectors * lanes,
        places=code.places,
        n_in=n_in,
        n_out=n_out,
        x_vector=n_in * lanes,
        y_vector=n_out * lanes,
        x_tile=n_in * vectors,
        parts="\n".join([_CALL.format(number=number) for number in range(len(code.parts))]),
    )
    calls = [_CALL_IN_ROWS.format(number=number, lanes=lanes) for number in range(len(code.parts))]
    lines += rows_ir(arithmetic, Place(code.places, n_in), [Place(code.places + n_in, n_out)], calls)
    return Batch("\n".join([*lines, text]), lanes * (code.places + max(1, vectors) * (n_in + n_out)))


_PART = """\
define internal void @part{number}(ptr noalias %x, ptr noalias %y, i64 %dx, i64 %dy, ptr noalias %w)
    nounwind noinline alignstack({bytes}) {{
start:"""
_CALL = "  call void @part{number}(ptr %x.at, ptr %y.at, i64 %dx, i64 %dy, ptr %w)"
_CALL_IN_ROWS = "  call void @part{number}(ptr %point, ptr %result0, i64 {lanes}, i64 {lanes}, ptr %w)"

_DIRECT = """\
define void @batch(ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy, ptr noalias %w) nounwind {{
start:
  br label %vector
vector:
  %i = phi i64 [ 0, %start ], [ %next, %vector ]
  %x.at = getelementptr double, ptr %x, i64 %i
  %y.at = getelementptr double, ptr %y, i64 %i
{parts}
  %next = add i64 %i, {lanes}
  %more = icmp slt i64 %next, %n
  br i1 %more, label %vector, label %end
end:
  ret void
}}
"""

# copy: to[row * to.row + k * to.vector] = from[row * from.row + k * from.vector], a vector each, for k < count
_TILED = """\
define void @batch(ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy, ptr noalias %w) nounwind {{
start:
  %points = getelementptr {t}, ptr %w, i64 {places}
  %results = getelementptr {t}, ptr %points, i64 {x_tile}
  br label %tile
tile:
  %i = phi i64 [ 0, %start ], [ %next, %end.tile ]
  %next = add i64 %i, {columns}
  %left = sub i64 %n, %i
  %whole = icmp sge i64 %left, {columns}
  %here = select i1 %whole, i64 {columns}, i64 %left
  %count = udiv i64 %here, {lanes}
  %x.tile = getelementptr double, ptr %x, i64 %i
  %y.tile = getelementptr double, ptr %y, i64 %i
  call void @copy(ptr %x.tile, ptr %points, i64 {n_in}, i64 %count, i64 %dx, i64 {lanes}, i64 {lanes}, i64 {x_vector})
  br label %vector
vector:
  %k = phi i64 [ 0, %tile ], [ %k.next, %vector ]
  %x.row = mul i64 %k, {n_in}
  %y.row = mul i64 %k, {n_out}
  %x.at = getelementptr {t}, ptr %points, i64 %x.row
  %y.at = getelementptr {t}, ptr %results, i64 %y.row
{parts}
  %k.next = add i64 %k, 1
  %k.more = icmp slt i64 %k.next, %count
  br i1 %k.more, label %vector, label %end.tile
end.tile:
  call void @copy(ptr %results, ptr %y.tile, i64 {n_out}, i64 %count, i64 {lanes}, i64 {y_vector}, i64 %dy, i64 {lanes})
  %more = icmp slt i64 %next, %n
  br i1 %more, label %tile, label %end
end:
  ret void
}}
define internal void @copy(ptr noalias %from, ptr noalias %to, i64 %rows, i64 %count,
                           i64 %from.row, i64 %from.vector, i64 %to.row, i64 %to.vector) nounwind noinline {{
start:
  br label %row.test
row.test:
  %r = phi i64 [ 0, %start ], [ %r.next, %row.end ]
  %r.more = icmp slt i64 %r, %rows
  br i1 %r.more, label %row, label %end
row:
  %a.at = mul i64 %r, %from.row
  %b.at = mul i64 %r, %to.row
  %a = getelementptr double, ptr %from, i64 %a.at
  %b = getelementptr double, ptr %to, i64 %b.at
  br label %vector
vector:
  %k = phi i64 [ 0, %row ], [ %k.next, %vector ]
  %c.at = mul i64 %k, %from.vector
  %d.at = mul i64 %k, %to.vector
  %c = getelementptr double, ptr %a, i64 %c.at
  %d = getelementptr double, ptr %b, i64 %d.at
  %v = load {t}, ptr %c, align 8
  store {t} %v, ptr %d, align 8
  %k.next = add i64 %k, 1
  %k.more = icmp slt i64 %k.next, %count
  br i1 %k.more, label %vector, label %row.end
row.end:
  %r.next = add i64 %r, 1
  br label %row.test
end:
  ret void
}}"""


def rows_ir(
    arithmetic: Arithmetic, points: Place, results: Sequence[Place], calls: Sequence[str], start: Sequence[str] = ()
) -> list[str]:
    """`void rows(double *x, double *y, int64_t n, int64_t dx, int64_t dy, double *w)`; point i begins at x + i dx.

    calls: what computes the results of the points, whose first vectors are %point and %result0, %result1, ..; end to
    end they are a row of y.  start: what stands once before it.
    """
    t, lanes = arithmetic.type, arithmetic.lanes
    counts = sorted({place.size for place in results})
    pointers, moves, column = [], [], 0
    for k, place in enumerate(results):
        pointers.append(f"  %result{k} = getelementptr {t}, ptr %w, i64 {place.start}")
        moves.append(f"  %y.at{k} = getelementptr double, ptr %y.at, i64 {column}")
        moves.append(f"  call void @scatter{place.size}(ptr %y.at{k}, ptr %result{k}, i64 %dy)")
        column += place.size
    return [
        *_mover("gather", points.size, arithmetic, filling=True),
        *[line for count in counts for line in _mover(f"scatter{count}", count, arithmetic, filling=False)],
        "define void @rows(ptr noalias %x, ptr noalias %y, i64 %n, i64 %dx, i64 %dy, ptr noalias %w) nounwind {",
        "start:",
        f"  %point = getelementptr {t}, ptr %w, i64 {points.start}",
        *pointers,
        *start,
        "  br label %vector",
        "vector:",
        "  %i = phi i64 [ 0, %start ], [ %next, %vector ]",
        "  %x.row = mul i64 %i, %dx",
        "  %y.row = mul i64 %i, %dy",
        "  %x.at = getelementptr double, ptr %x, i64 %x.row",
        "  %y.at = getelementptr double, ptr %y, i64 %y.row",
        "  call void @gather(ptr %x.at, ptr %point, i64 %dx)",
        *calls,
        *moves,
        f"  %next = add i64 %i, {lanes}",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %vector, label %end",
        "end:",
        "  ret void",
        "}",
    ]


def _mover(name: str, count: int, arithmetic: Arithmetic, *, filling: bool) -> list[str]:
    """The function that fills `count` vectors from rows, d doubles apart, of as many points as there are lanes.

    filling: this way, else from vectors to rows. The last block begins where it ends with the row, in the one before.
    """
    lanes = arithmetic.lanes
    head = f"define internal void @{name}(ptr noalias %rows, ptr noalias %vectors, i64 %d) nounwind noinline {{"
    starts = [f"  %row{k}.at = mul i64 %d, {k}" for k in range(lanes)]
    starts += [f"  %row{k} = getelementptr double, ptr %rows, i64 %row{k}.at" for k in range(lanes)]
    if count < lanes:
        return [head, "start:", *starts, *_one_by_one(count, lanes, filling), "  ret void", "}"]
    return [
        head,
        "start:",
        *starts,
        "  br label %block",
        "block:",
        "  %r = phi i64 [ 0, %start ], [ %r.next, %block ]",
        *_block(arithmetic, filling),
        f"  %r.then = add i64 %r, {lanes}",
        f"  %r.far = icmp sgt i64 %r.then, {count - lanes}",
        f"  %r.next = select i1 %r.far, i64 {count - lanes}, i64 %r.then",
        f"  %r.more = icmp slt i64 %r, {count - lanes}",
        "  br i1 %r.more, label %block, label %end",
        "end:",
        "  ret void",
        "}",
    ]


def _block(arithmetic: Arithmetic, filling: bool) -> list[str]:
    """Lines for one square: they transpose what begins in column %r of the rows."""
    t, lanes = arithmetic.type, arithmetic.lanes
    lines = []
    for k in range(lanes):
        lines += [
            f"  %of.row{k} = getelementptr double, ptr %row{k}, i64 %r",
            f"  %r{k} = add i64 %r, {k}",
            f"  %of.vector{k} = getelementptr {t}, ptr %vectors, i64 %r{k}",
        ]
    source, target = ("row", "vector") if filling else ("vector", "row")
    lines += [f"  %v{k}.0 = load {t}, ptr %of.{source}{k}, align 8" for k in range(lanes)]
    distance, stage = 1, 0
    while distance < lanes:  # blocks of 2, 4, .. rows and columns, of which the off-diagonal halves change places
        for i in range(lanes):
            first, second = f"%v{i & ~distance}.{stage}", f"%v{i | distance}.{stage}"
            mask = ", ".join([f"i32 {_taken(i, lane, distance, lanes)}" for lane in range(lanes)])
            lines.append(f"  %v{i}.{stage + 1} = shufflevector {t} {first}, {t} {second}, <{lanes} x i32> <{mask}>")
        distance, stage = 2 * distance, stage + 1
    return [*lines, *[f"  store {t} %v{k}.{stage}, ptr %of.{target}{k}, align 8" for k in range(lanes)]]


def _taken(row: int, lane: int, distance: int, lanes: int) -> int:
    """Lane of two rows, the one with this bit clear first, that goes to a lane of a row."""
    return (lane & ~distance | (row & distance)) + (lanes if lane & distance else 0)


def _one_by_one(count: int, lanes: int, filling: bool) -> list[str]:
    """The moves of fewer numbers than a vector has lanes."""
    lines = []
    for k in range(lanes):
        for r in range(count):
            name = f"%at{k}.{r}"
            source, target = (f"{name}.row", f"{name}.vector") if filling else (f"{name}.vector", f"{name}.row")
            lines += [
                f"  {name}.row = getelementptr double, ptr %row{k}, i64 {r}",
                f"  {name}.vector = getelementptr double, ptr %vectors, i64 {r * lanes + k}",
                f"  {name} = load double, ptr {source}, align 8",
                f"  store double {name}, ptr {target}, align 8",
            ]
    return lines
