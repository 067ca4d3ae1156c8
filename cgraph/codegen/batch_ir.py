"""LLVM's text for a batch: the graph on one vector of columns after another.

Points lie in columns, side by side, or in rows, one after another (see `transposed_ir`). The numbers of points in
columns lie far apart in a large batch, each in a page of memory of its own, often by a power of two, where few of them
fit in a cache at once. So where there are many, the inputs of some vectors, a tile, are brought together at a time, and
results go out together.
"""

from __future__ import annotations

from typing import NamedTuple

from ..core.graph import Graph
from .arithmetic import REGISTERS, Arithmetic
from .llvm_ir import instructions, preamble
from .transposed_ir import Place, rows_ir

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
