"""Take, Push, Pop: numbers of registers gathered into others, and kept on a stack."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...codegen.arithmetic import Arithmetic, words_of
from ...core.checks import GraphError
from ...core.evaluation import Array
from ..statement import (
    Execution,
    Lengths,
    Names,
    Statement,
    length_of,
    require_length,
    require_once,
)
from .function_writer import FunctionWriter

if TYPE_CHECKING:
    from ..writer import Writer


@dataclass(frozen=True)
class Take(Statement):
    """target[i] = source[table[i]].

    >>> from cgraph.extend import Program, Take, runner
    >>> run = runner(Program({"a": 3, "b": 2}, [Take("a", "b", (2, 0))], record=["b"]))
    >>> run.run(run.memory({"a": [5.0, 6.0, 7.0]}), passes=1).rows.tolist()
    [[7.0, 5.0]]
    """

    source: str
    target: str
    table: tuple[int, ...]


@dataclass(frozen=True)
class Push(Statement):
    """Numbers of registers `rows`, end to end, as one more row of a stack; a full one gets none, and its count is NaN.

    stack: a register whose length is a multiple of that of a row.  count: one of length 1, how many rows there are.

    >>> from cgraph.extend import Program, Push, runner
    >>> run = runner(Program({"x": 1, "stack": 2, "count": 1}, [Push("stack", "count", ("x",))], record=["count"]))
    >>> run.run(run.memory({"x": 8.0}), passes=3).rows.ravel().tolist()
    [1.0, 2.0, nan]
    """

    stack: str
    count: str
    rows: Names


@dataclass(frozen=True)
class Pop(Statement):
    """The last row of a stack, taken off it into registers; NaN, and the count NaN, of one that has none. Fields: see
    `Push`.

    >>> from cgraph.extend import Pop, Program, runner
    >>> run = runner(Program({"x": 1, "stack": 2, "count": 1}, [Pop("stack", "count", ("x",))], record=["x"]))
    >>> run.run(run.memory({"stack": [4.0, 5.0], "count": 2.0}), passes=3).rows.ravel().tolist()
    [5.0, 4.0, nan]
    """

    stack: str
    count: str
    rows: Names


def check_take(take: Take, lengths: Lengths) -> None:
    """Raises GraphError if a place is not in the source, or there are not as many as the target has numbers."""
    size = length_of(lengths, "Take", take.source)
    require_length(lengths, "Take", take.target, len(take.table))
    if outside := [place for place in take.table if not (isinstance(place, int) and 0 <= place < size)]:
        raise GraphError(f"Take needs places from 0 to {size - 1} of register {take.source!r}, got {outside[0]!r:.60}")


def check_stack(statement: Push | Pop, lengths: Lengths) -> None:
    """Raises GraphError if the stack does not hold whole rows."""
    where = type(statement).__name__
    size = length_of(lengths, where, statement.stack)
    require_length(lengths, where, statement.count, 1)
    width = sum([length_of(lengths, where, name) for name in statement.rows])
    if width and size % width:
        raise GraphError(f"{where} needs a stack of rows of {width} numbers, register {statement.stack!r} holds {size}")
    if isinstance(statement, Pop):
        require_once(where, statement.rows)


def run_take(take: Take, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    execution.write(state, take.target, np.asarray(state[take.source], dtype=np.float64)[list(take.table)])


def run_push(push: Push, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many, each with a count of its own."""
    stack, row = np.array(state[push.stack]), _row(state, push)
    count, number = np.asarray(state[push.count]), np.asarray(state[push.count]).ravel()
    fits = (number >= 0.0) & (number < _most(push, execution.lengths))
    lanes = np.flatnonzero(fits)
    stack.reshape(len(stack), number.size)[_places(number[lanes], len(row)), lanes] = row[:, lanes]
    execution.write(state, push.stack, stack)
    execution.write(state, push.count, np.where(fits, number + 1.0, math.nan).reshape(count.shape))


def run_pop(pop: Pop, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    stack, row = np.asarray(state[pop.stack]), np.full_like(_row(state, pop), math.nan)
    count, number = np.asarray(state[pop.count]), np.asarray(state[pop.count]).ravel()
    some = (number > 0.0) & (number <= _most(pop, execution.lengths))
    lanes = np.flatnonzero(some)
    row[:, lanes] = stack.reshape(len(stack), number.size)[_places(number[lanes] - 1.0, len(row)), lanes]
    execution.write(state, pop.count, np.where(some, number - 1.0, math.nan).reshape(count.shape))
    at = 0
    for name in pop.rows:
        length = execution.lengths[name]
        execution.write(state, name, row[at : at + length].reshape(length, *count.shape[1:]))
        at += length


def _row(state: dict[str, Any], statement: Push | Pop) -> Array:
    """The numbers of the registers, end to end, (width, memories)."""
    count = np.asarray(state[statement.count])
    parts = [np.asarray(state[name], dtype=np.float64).reshape(-1, count.size) for name in statement.rows]
    return np.concatenate([np.empty((0, count.size)), *parts])


def _most(statement: Push | Pop, lengths: Lengths) -> float:
    """The rows that the stack has room for."""
    width = sum([lengths[name] for name in statement.rows])
    return float(lengths[statement.stack] // width) if width else math.inf


def _places(number: Array, width: int) -> NDArray[np.int_]:
    """Places of the rows of these numbers in a stack, (width, N)."""
    return number.astype(int) * width + np.arange(width)[:, None]


def take_text(take: Take, writer: Writer) -> None:
    """Write as machine code."""
    name = writer.functions.take(take.table)
    writer.calls(name, (take.source,), (take.target,))


def push_text(push: Push, writer: Writer) -> None:
    """if (0 <= count < most) { stack[count] = row; count += 1 } else count = NaN, in every lane."""
    lanes, count = _Lanes(writer), writer.load(push.count)
    fits = lanes.both(("oge", count, 0.0), ("olt", count, _most(push, writer.registers)))
    begin = lanes.begin(fits, count, sum(writer.lengths(push.rows)))
    lanes.move("stack.put", push.stack, begin, push.rows)
    lanes.count(push.count, fits, writer.value(f"fadd {writer.type} {count}, {writer.number(1.0)}"))


def pop_text(pop: Pop, writer: Writer) -> None:
    """if (0 < count <= most) { count -= 1; row = stack[count] } else row = count = NaN, in every lane."""
    lanes, count = _Lanes(writer), writer.load(pop.count)
    some = lanes.both(("ogt", count, 0.0), ("ole", count, _most(pop, writer.registers)))
    left = writer.value(f"fsub {writer.type} {count}, {writer.number(1.0)}")
    begin = lanes.begin(some, left, sum(writer.lengths(pop.rows)))
    for name in pop.rows:
        writer.fill_with_nan(name)
    lanes.move("stack.get", pop.stack, begin, pop.rows)
    lanes.count(pop.count, some, left)


class _Lanes:
    """Text over lanes, in some of which a condition holds."""

    def __init__(self, writer: Writer) -> None:
        self._writer, self._bits = writer, words_of(writer.functions.arithmetic)["b"]

    def both(self, *comparisons: tuple[str, str, float]) -> str:
        """Condition that holds in the lanes where two comparisons do."""
        writer = self._writer
        a, b = [writer.value(f"fcmp {name} {writer.type} {x}, {writer.number(y)}") for name, x, y in comparisons]
        return writer.value(f"and {self._bits} {a}, {b}")

    def begin(self, condition: str, number: str, width: int) -> str:
        """The address of where rows of these numbers begin in a stack; -1 where the condition does not hold."""
        writer, t = self._writer, self._writer.type
        begin = writer.value(f"fmul {t} {number}, {writer.number(float(width))}")
        begin = writer.value(f"select {self._bits} {condition}, {t} {begin}, {t} {writer.number(-1.0)}")
        writer.scratch.append(f"  {begin}.at = alloca {t}, align 64")
        writer.line(f"store {t} {begin}, ptr {begin}.at, align 8")
        return f"{begin}.at"

    def move(self, name: str, stack: str, begin: str, names: Names) -> None:
        """Move between rows of the stack and registers, end to end: to it, "stack.put", or from it, "stack.get"."""
        writer, at = self._writer, 0
        function = writer.functions.text(name, partial(_move_text, name=name))
        for register in names:
            length = writer.registers[register]
            pointers = f"ptr {writer.pointer(stack)}, ptr {begin}, ptr {writer.pointer(register)}"
            writer.line(f"call void @{function}({pointers}, i64 {at}, i64 {length})")
            at += length

    def count(self, register: str, condition: str, after: str) -> None:
        """The count after, NaN where the condition does not hold."""
        writer, t = self._writer, self._writer.type
        nan = writer.number(math.nan)
        writer.store(writer.value(f"select {self._bits} {condition}, {t} {after}, {t} {nan}"), register)


def _move_text(arithmetic: Arithmetic, name: str) -> list[str]:
    """`void name(stack, begin, row, at, n)`: stack[begin + at + j] = row[j], or back, in lanes where begin >= 0."""
    ir = FunctionWriter(arithmetic)
    with ir.each_lane() as lane:
        begin = ir.load_double(ir.double_at("%begin", "0", lane))
        there = ir.value(f"fcmp oge double {begin}, 0.0")
        count = ir.value(f"select i1 {there}, i64 %n, i64 0")
        first = ir.value(f"add i64 {ir.value(f'fptosi double {begin} to i64')}, %at")
        with ir.loop("0", count) as j:
            in_stack = ir.double_at("%stack", ir.value(f"add i64 {first}, {j}"), lane)
            source, target = in_stack, ir.double_at("%row", j, lane)
            if name == "stack.put":
                source, target = target, source
            ir.do(f"store double {ir.load_double(source)}, ptr {target}, align 8")
    return ir.function(name, "ptr %stack, ptr %begin, ptr %row, i64 %at, i64 %n")
