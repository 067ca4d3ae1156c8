"""Take, Scatter, Push, Pop: numbers of registers gathered into others, put among them, and kept on a stack."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...codegen.arithmetic import Arithmetic
from ...codegen.function_writer import FunctionWriter
from ...core.checks import GraphError
from ..statement import Execution, Lengths, Names, Statement, length_of, require_length, require_once

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
class Scatter(Statement):
    """target[places[i]] = source[table[i]]; other numbers of the target stay as they are."""

    source: str
    target: str
    table: tuple[int, ...]
    places: tuple[int, ...]


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


def check_numbers(statement: Take | Scatter, lengths: Lengths) -> None:
    """Raises GraphError if a place is outside of its register, or there are not as many on either side."""
    kind, sides = type(statement).__name__, [(statement.source, statement.table)]
    if isinstance(statement, Scatter):
        sides.append((statement.target, statement.places))
    else:
        require_length(lengths, kind, statement.target, len(statement.table))
    for name, places in sides:
        size = length_of(lengths, kind, name)
        if outside := [place for place in places if not (isinstance(place, int) and 0 <= place < size)]:
            raise GraphError(f"{kind} needs places from 0 to {size - 1} of register {name!r}, got {outside[0]!r:.60}")
    if len(sides[-1][1]) != len(statement.table):
        raise GraphError(f"{kind} needs a place for each of {len(statement.table)} numbers, got {len(sides[-1][1])}")


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


def run_numbers(statement: Take | Scatter, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many."""
    numbers = np.asarray(state[statement.source], dtype=np.float64)[list(statement.table)]
    if isinstance(statement, Scatter):
        target = np.array(state[statement.target], dtype=np.float64)
        target[list(statement.places)] = numbers
        numbers = target
    execution.write(state, statement.target, numbers)


def run_stack(statement: Push | Pop, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, of one memory or of many, each with a count of its own."""
    push, count = isinstance(statement, Push), np.asarray(state[statement.count])
    number, most = count.ravel(), _most(statement, execution.lengths)
    fits = (number >= 0.0) & (number < most) if push else (number > 0.0) & (number <= most)
    lanes, after = np.flatnonzero(fits), number + (1.0 if push else -1.0)
    parts = [np.asarray(state[name], dtype=np.float64).reshape(-1, count.size) for name in statement.rows]
    row, stack = np.concatenate([np.empty((0, count.size)), *parts]), np.array(state[statement.stack])
    first = np.minimum(number, after)[lanes].astype(int)
    places = (first * len(row) + np.arange(len(row))[:, None], lanes)
    if push:
        stack.reshape(len(stack), number.size)[places] = row[:, lanes]
        execution.write(state, statement.stack, stack)
    else:
        row[...] = math.nan
        row[:, lanes] = stack.reshape(len(stack), number.size)[places]
        for name, part in zip(statement.rows, np.split(row, np.cumsum([*map(len, parts)])[:-1]), strict=True):
            execution.write(state, name, part.reshape(len(part), *count.shape[1:]))
    execution.write(state, statement.count, np.where(fits, after, math.nan).reshape(count.shape))


def _most(statement: Push | Pop, lengths: Lengths) -> float:
    """The rows that the stack has room for."""
    width = sum([lengths[name] for name in statement.rows])
    return float(lengths[statement.stack] // width) if width else math.inf


def numbers_text(statement: Take | Scatter, writer: Writer) -> None:
    """Write as machine code."""
    if isinstance(statement, Take):
        writer.calls(writer.functions.take(statement.table), (statement.source,), (statement.target,))
    else:
        name = writer.functions.take(statement.table, statement.places)
        writer.call(name, [writer.pointer(statement.source), writer.pointer(statement.target)])


def stack_text(statement: Push | Pop, writer: Writer) -> None:
    """if (0 <= count < most) { stack[count] = row; count += 1 } else count = NaN, in every lane; or back."""
    push, most, count = isinstance(statement, Push), _most(statement, writer.registers), writer.load(statement.count)
    low, high = (
        writer.compare("oge" if push else "ogt", count, 0.0),
        writer.compare("olt" if push else "ole", count, most),
    )
    fits = writer.value(f"and {writer.bits} {low}, {high}")
    after = writer.value(f"{'fadd' if push else 'fsub'} {writer.type} {count}, {writer.number(1.0)}")
    for name in () if push else statement.rows:
        writer.fill_with_nan(name)
    width, begin, at = writer.number(float(sum(writer.lengths(statement.rows)))), writer.room(), 0
    first = writer.value(f"fmul {writer.type} {count if push else after}, {width}")
    writer.store_at(writer.choose(fits, first, -1.0), begin)
    function = "stack.put" if push else "stack.get"
    function = writer.functions.text(function, partial(_move_text, name=function))
    for register in statement.rows:  # in the lanes where begin >= 0
        length = writer.registers[register]
        writer.call(function, [writer.pointer(statement.stack), begin, writer.pointer(register)], at, length)
        at += length
    writer.store(writer.choose(fits, after, math.nan), statement.count)


def _move_text(arithmetic: Arithmetic, name: str) -> list[str]:
    """`void name(stack, begin, row, at, n)`: stack[begin + at + j] = row[j], or back, in lanes where begin >= 0."""
    ir = FunctionWriter(arithmetic)
    with ir.each_lane() as lane:
        begin = ir.load_at(ir.double_at("%begin", "0", lane), "double")
        with ir.when(ir.value(f"fcmp oge double {begin}, 0.0")):
            first = ir.integer("add", ir.value(f"fptosi double {begin} to i64"), "%at")
            with ir.loop(0, "%n") as j:
                ends = [ir.double_at("%stack", ir.integer("add", first, j), lane), ir.double_at("%row", j, lane)]
                target, source = ends if name == "stack.put" else ends[::-1]
                ir.store_at(ir.load_at(source, "double"), target, "double")
    return ir.function(f"internal void @{name}(ptr %stack, ptr %begin, ptr %row, i64 %at, i64 %n) nounwind")
