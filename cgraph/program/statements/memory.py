"""Take, Scatter, Push, Pop: numbers of registers gathered into others, put among them, and kept on a stack."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...codegen.arithmetic import Arithmetic
from ...codegen.function_writer import FunctionWriter
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


def check_take(take: Take, lengths: Lengths) -> None:
    """Raises GraphError if a place is not in the source, or there are not as many as the target has numbers."""
    size = length_of(lengths, "Take", take.source)
    require_length(lengths, "Take", take.target, len(take.table))
    if outside := [place for place in take.table if not (isinstance(place, int) and 0 <= place < size)]:
        raise GraphError(f"Take needs places from 0 to {size - 1} of register {take.source!r}, got {outside[0]!r:.60}")


def check_scatter(statement: Scatter, lengths: Lengths) -> None:
    """Raises GraphError if a place is outside of its register, or there are not as many on either side."""
    for name, places in ((statement.source, statement.table), (statement.target, statement.places)):
        size = length_of(lengths, "Scatter", name)
        if places and not 0 <= min(places) <= max(places) < size:
            raise GraphError(f"Scatter needs places from 0 to {size - 1} of register {name!r}")
    if len(statement.table) != len(statement.places):
        raise GraphError(
            f"Scatter needs a place for each of {len(statement.table)} numbers, got {len(statement.places)}"
        )


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


def run_scatter(statement: Scatter, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python."""
    if execution.many >= 0:  # else in place
        state[statement.target] = np.array(state[statement.target])
    source, target = state[statement.source], state[statement.target]
    for number, place in zip(statement.table, statement.places, strict=True):
        target[place] = source[number] if execution.many >= 0 else float(source[number])


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


def scatter_text(scatter: Scatter, writer: Writer) -> None:
    """Write as machine code."""
    name = writer.functions.take(scatter.table, scatter.places)
    writer.call(name, [writer.pointer(scatter.source), writer.pointer(scatter.target)])


def push_text(push: Push, writer: Writer) -> None:
    """if (0 <= count < most) { stack[count] = row; count += 1 } else count = NaN, in every lane."""
    count, one = writer.load(push.count), writer.number(1.0)
    fits = _both(writer, writer.compare("oge", count, 0.0), writer.compare("olt", count, _most(push, writer.registers)))
    _move(writer, "stack.put", push, fits, count)
    after = writer.value(f"fadd {writer.type} {count}, {one}")
    writer.store(writer.choose(fits, after, math.nan), push.count)


def pop_text(pop: Pop, writer: Writer) -> None:
    """if (0 < count <= most) { count -= 1; row = stack[count] } else row = count = NaN, in every lane."""
    count, one = writer.load(pop.count), writer.number(1.0)
    some = _both(writer, writer.compare("ogt", count, 0.0), writer.compare("ole", count, _most(pop, writer.registers)))
    left = writer.value(f"fsub {writer.type} {count}, {one}")
    for name in pop.rows:
        writer.fill_with_nan(name)
    _move(writer, "stack.get", pop, some, left)
    writer.store(writer.choose(some, left, math.nan), pop.count)


def _both(writer: Writer, a: str, b: str) -> str:
    """The lanes in which two conditions hold."""
    return writer.value(f"and {writer.bits} {a}, {b}")


def _move(writer: Writer, name: str, statement: Push | Pop, condition: str, number: str) -> None:
    """Row `number` of a stack to its registers, "stack.get", or back, "stack.put", in the lanes of a condition."""
    begin, at = writer.room(), 0
    first = writer.value(f"fmul {writer.type} {number}, {writer.number(float(sum(writer.lengths(statement.rows))))}")
    writer.store_at(writer.choose(condition, first, -1.0), begin)
    function = writer.functions.text(name, partial(_move_text, name=name))
    for register in statement.rows:
        length = writer.registers[register]
        writer.call(function, [writer.pointer(statement.stack), begin, writer.pointer(register)], at, length)
        at += length


def _move_text(arithmetic: Arithmetic, name: str) -> list[str]:
    """`void name(stack, begin, row, at, n)`: stack[begin + at + j] = row[j], or back, in lanes where begin >= 0."""
    ir = FunctionWriter(arithmetic)
    with ir.each_lane() as lane:
        begin = ir.load_at(ir.double_at("%begin", "0", lane), "double")
        with ir.when(ir.value(f"fcmp oge double {begin}, 0.0")):
            first = ir.integer("add", ir.value(f"fptosi double {begin} to i64"), "%at")
            with ir.loop(0, "%n") as j:
                in_stack, in_row = (
                    ir.double_at("%stack", ir.integer("add", first, j), lane),
                    ir.double_at("%row", j, lane),
                )
                source, target = (in_row, in_stack) if name == "stack.put" else (in_stack, in_row)
                ir.store_at(ir.load_at(source, "double"), target, "double")
    return ir.function(f"internal void @{name}(ptr %stack, ptr %begin, ptr %row, i64 %at, i64 %n) nounwind")
