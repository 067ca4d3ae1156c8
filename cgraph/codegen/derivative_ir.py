"""LLVM's text for a derivative along directions: what the point decides once, the rest over lanes of directions."""

from __future__ import annotations

from ..autodiff.direction_split import DirectionSplit
from .arithmetic import Arithmetic
from .llvm_ir import body, point_arithmetic, preamble

# What the one argument of `sweep` points to: addresses and counts, eight bytes each.
FIELDS = ("x", "p", "s", "y", "groups", "take", "put", "values", "entries")


def sweep_ir(split: DirectionSplit, lanes: int, flags: str, registers: int, *, check: bool) -> str:
    """A module with `int sweep(int64_t *fields)`, the derivative y of a point x along directions s.

    Directions come in groups of `lanes`: entry k of the group g is the vector s[g][k], and likewise for y. p is room
    for the values between the two parts, zeros behind them up to a whole vector; with `check` the result is 1 if one of
    them is infinite or NaN. Then values[put[e]] = y[take[e]] for e = 0 .. entries - 1, y read as one row of numbers.
    """
    point, vector = point_arithmetic(flags, registers), Arithmetic(flags, lanes, registers)
    primal = body(split.primal, point, _address, "primal", ["ptr %x", "ptr %y"])
    known = len(split.primal.outputs)

    def address(base: str, name: str, row: int) -> list[str]:
        if base == "x" and row < known:
            return [f"  {name} = getelementptr double, ptr %p, i64 {row}"]
        base, row = ("s", row - known) if base == "x" else (base, row)
        return [f"  {name} = getelementptr {vector.type}, ptr %{base}, i64 {row}"]

    linear = body(split.linear, vector, address, "linear", ["ptr %p", "ptr %s", "ptr %y"], uniform=known)
    lines = [
        *preamble([split.primal], point),
        *primal.definitions,
        "define internal void @primal(ptr noalias %x, ptr noalias %y) nounwind {",
        "start:",
        *primal.start,
        *primal.lines,
        "  ret void",
        "}",
        *linear.definitions,
        "define internal void @linear(ptr noalias %p, ptr noalias %s, ptr noalias %y) nounwind {",
        "start:",
        *linear.start,
        *linear.lines,
        "  ret void",
        "}",
        *_sweep(split.directions * lanes, len(split.linear.outputs) * lanes),
        *_end(whole(known, lanes) if check else 0, vector),
    ]
    return "\n".join([*lines, ""])


def _address(base: str, name: str, row: int) -> list[str]:
    return [f"  {name} = getelementptr double, ptr %{base}, i64 {row}"]


def whole(count: int, lanes: int) -> int:
    """At least so many numbers, in whole vectors."""
    return -(-count // lanes) * lanes


def _sweep(seeds: int, results: int) -> list[str]:
    """The function that calls the others, without its end. seeds, results: numbers in a group."""
    fields = []
    for k, name in enumerate(FIELDS):
        kind = "i64" if name in ("groups", "entries") else "ptr"
        fields.append(f"  %{name}.field = getelementptr i64, ptr %fields, i64 {k}")
        fields.append(f"  %{name} = load {kind}, ptr %{name}.field, align 8")
    return [
        "define i32 @sweep(ptr noalias %fields) nounwind {",
        "start:",
        *fields,
        "  call void @primal(ptr %x, ptr %p)",
        "  br label %group",
        "group:",
        "  %g = phi i64 [ 0, %start ], [ %g.next, %group.body ]",
        "  %g.more = icmp slt i64 %g, %groups",
        "  br i1 %g.more, label %group.body, label %entry",
        "group.body:",
        f"  %s.row = mul i64 %g, {seeds}",
        f"  %y.row = mul i64 %g, {results}",
        "  %s.here = getelementptr double, ptr %s, i64 %s.row",
        "  %y.here = getelementptr double, ptr %y, i64 %y.row",
        "  call void @linear(ptr %p, ptr %s.here, ptr %y.here)",
        "  %g.next = add i64 %g, 1",
        "  br label %group",
        "entry:",
        "  %e = phi i64 [ 0, %group ], [ %e.next, %entry.body ]",
        "  %e.more = icmp slt i64 %e, %entries",
        "  br i1 %e.more, label %entry.body, label %done",
        "entry.body:",
        "  %take.at = getelementptr i64, ptr %take, i64 %e",
        "  %put.at = getelementptr i64, ptr %put, i64 %e",
        "  %from = load i64, ptr %take.at, align 8",
        "  %to = load i64, ptr %put.at, align 8",
        "  %from.at = getelementptr double, ptr %y, i64 %from",
        "  %to.at = getelementptr double, ptr %values, i64 %to",
        "  %value = load double, ptr %from.at, align 8",
        "  store double %value, ptr %to.at, align 8",
        "  %e.next = add i64 %e, 1",
        "  br label %entry",
    ]


def _end(known: int, vector: Arithmetic) -> list[str]:
    """What the function gives: whether one of so many numbers in p is infinite or NaN."""
    t, lanes = vector.type, vector.lanes
    if not known:
        return ["done:", "  ret i32 0", "}"]
    return [
        "done:",  # the last, when p has long been written
        "  br label %check",
        "check:",  # v - v is 0, or NaN where v is infinite or NaN
        "  %k = phi i64 [ 0, %done ], [ %k.next, %check ]",
        f"  %lost = phi {t} [ zeroinitializer, %done ], [ %lost.next, %check ]",
        "  %v.at = getelementptr double, ptr %p, i64 %k",
        f"  %v = load {t}, ptr %v.at, align 8",
        f"  %v.lost = fsub {t} %v, %v",
        f"  %lost.next = fadd {t} %lost, %v.lost",
        f"  %k.next = add i64 %k, {lanes}",
        f"  %k.more = icmp slt i64 %k.next, {known}",
        "  br i1 %k.more, label %check, label %end",
        "end:",
        f"  %nan = fcmp uno {t} %lost.next, zeroinitializer",
        f"  %any = call i1 @llvm.vector.reduce.or.v{lanes}i1(<{lanes} x i1> %nan)",
        "  %result = zext i1 %any to i32",
        "  ret i32 %result",
        "}",
    ]
