"""LLVM's text for a batch that lies in rows, a point after another: vectors filled from rows and emptied into rows.

A block of as many numbers of as many points as a vector has lanes is a square, which some shuffles transpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .arithmetic import Arithmetic


class Place(NamedTuple):
    """Where numbers lie in the memory w: `size` vectors, from the vector `start` on."""

    start: int
    size: int


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
    """One square: lines that transpose what begins in column %r of the rows."""
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
    """Which lane of two rows, the one with this bit clear first, goes to a lane of a row."""
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
