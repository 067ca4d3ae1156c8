"""Take, Push, Pop: numbers of registers gathered into others, and kept on a stack."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...codegen.arithmetic import Arithmetic
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

State = dict[str, list[float]]


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


def run_take(take: Take, state: State, _: Execution) -> None:
    """In Python."""
    source = state[take.source]
    state[take.target] = [source[place] for place in take.table]


def take_beside(take: Take, state: dict[str, Array], _: Execution) -> None:
    """Of many memories."""
    state[take.target] = state[take.source][list(take.table)]


def run_push(push: Push, state: State, _: Execution) -> None:
    """In Python."""
    row = [value for name in push.rows for value in state[name]]
    stack, count = state[push.stack], state[push.count][0]
    if count * len(row) < len(stack) or (not row and count >= 0.0):
        at = int(count) * len(row)
        state[push.stack] = [*stack[:at], *row, *stack[at + len(row) :]]
        state[push.count] = [count + 1.0]
    else:
        state[push.count] = [math.nan]


def run_pop(pop: Pop, state: State, _: Execution) -> None:
    """In Python."""
    width, count = sum([len(state[name]) for name in pop.rows]), state[pop.count][0]
    row, after = [math.nan] * width, math.nan
    if count > 0.0:
        at, after = (int(count) - 1) * width, count - 1.0
        row = state[pop.stack][at : at + width]
    state[pop.count] = [after]
    for name in pop.rows:
        length = len(state[name])
        state[name], row = row[:length], row[length:]


def push_beside(push: Push, state: dict[str, Array], _: Execution) -> None:
    """Of many memories, each with a count of its own."""
    row = _row(state, push.rows)
    stack, count = state[push.stack].copy(), state[push.count][0]
    width, most = len(row), len(stack) // len(row) if len(row) else math.inf
    fits = (count >= 0.0) & (count < most)
    lanes = np.flatnonzero(fits)
    stack[_places(count[lanes], width), lanes] = row[:, lanes]
    state[push.stack], state[push.count] = stack, np.where(fits, count + 1.0, math.nan)[None]


def pop_beside(pop: Pop, state: dict[str, Array], _: Execution) -> None:
    """Of many memories."""
    row = np.full_like(_row(state, pop.rows), math.nan)
    stack, count = state[pop.stack], state[pop.count][0]
    width, most = len(row), len(stack) // len(row) if len(row) else math.inf
    some = (count > 0.0) & (count <= most)
    lanes = np.flatnonzero(some)
    row[:, lanes] = stack[_places(count[lanes] - 1.0, width), lanes]
    state[pop.count] = np.where(some, count - 1.0, math.nan)[None]
    at = 0
    for name in pop.rows:
        length = len(state[name])
        state[name] = row[at : at + length]
        at += length


def _row(state: dict[str, Array], names: Names) -> Array:
    none = next(iter(state.values()))[:0]
    return np.concatenate([none, *[state[name] for name in names]])


def _places(number: Array, width: int) -> NDArray[np.int_]:
    """Where the rows of these numbers lie in a stack, (width, N)."""
    return number.astype(int) * width + np.arange(width)[:, None]


def take_text(take: Take, writer: Writer) -> None:
    """As machine code."""
    name = writer.functions.take(take.table)
    writer.calls(name, (take.source,), (take.target,))


def push_text(push: Push, writer: Writer) -> None:
    """if (count < most) { stack[count] = row; count += 1 } else count = NaN."""
    label, at = writer.label("push"), _Places(writer, push.rows)
    most = writer.registers[push.stack] // at.width if at.width else math.inf
    if writer.functions.arithmetic.lanes > 1:
        _push_lanes(push, writer, float(most))
        return
    count = writer.load(push.count)
    fits = writer.value(f"fcmp olt double {count}, {writer.number(float(most))}")
    writer.branch_on(fits, f"{label}.fits", f"{label}.full")
    writer.block(f"{label}.fits")
    for pointer, name in at.row(push.stack, count):
        writer.copy(pointer, writer.pointer(name), writer.registers[name])
    writer.store(writer.value(f"fadd double {count}, 1.0"), push.count)
    writer.jump(f"{label}.end")
    writer.block(f"{label}.full")
    writer.store(writer.number(math.nan), push.count)
    writer.jump(f"{label}.end")
    writer.block(f"{label}.end")


def pop_text(pop: Pop, writer: Writer) -> None:
    """if (count > 0) { count -= 1; row = stack[count] } else row = count = NaN."""
    label, at = writer.label("pop"), _Places(writer, pop.rows)
    if writer.functions.arithmetic.lanes > 1:
        _pop_lanes(pop, writer, at.width)
        return
    count = writer.load(pop.count)
    writer.branch(pop.count, f"{label}.some", f"{label}.none")
    writer.block(f"{label}.some")
    left = writer.value(f"fsub double {count}, 1.0")
    for pointer, name in at.row(pop.stack, left):
        writer.copy(writer.pointer(name), pointer, writer.registers[name])
    writer.store(left, pop.count)
    writer.jump(f"{label}.end")
    writer.block(f"{label}.none")
    for name in (pop.count, *pop.rows):
        writer.fill_with_nan(name)
    writer.jump(f"{label}.end")
    writer.block(f"{label}.end")


class _Places:
    """Where the registers of a row lie in a stack."""

    def __init__(self, writer: Writer, names: Names) -> None:
        self._writer, self._names = writer, names
        self.width = sum(writer.lengths(names))

    def row(self, stack: str, number: str) -> list[tuple[str, str]]:
        """(address, register) of the parts of the row of that number, a double."""
        writer, places = self._writer, []
        start = writer.value(f"mul i64 {writer.value(f'fptosi double {number} to i64')}, {self.width}")
        for name in self._names:
            places.append((writer.value(f"getelementptr double, ptr {writer.pointer(stack)}, i64 {start}"), name))
            start = writer.value(f"add i64 {start}, {writer.registers[name]}")
        return places


# of lanes: every one has a row of its own


def _push_lanes(push: Push, writer: Writer, most: float) -> None:
    """As `push_text`, in every lane."""
    lanes, count = _Lanes(writer), writer.load(push.count)
    fits = lanes.both(("oge", count, 0.0), ("olt", count, most))
    begin = lanes.begin(fits, count, sum(writer.lengths(push.rows)))
    lanes.move(writer.functions.text("stack.put", _put_text), push.stack, begin, push.rows)
    lanes.count(push.count, fits, writer.value(f"fadd {writer.type} {count}, {writer.number(1.0)}"))


def _pop_lanes(pop: Pop, writer: Writer, width: int) -> None:
    """As `pop_text`, in every lane."""
    lanes, count = _Lanes(writer), writer.load(pop.count)
    most = writer.registers[pop.stack] // width if width else math.inf
    some = lanes.both(("ogt", count, 0.0), ("ole", count, float(most)))
    left = writer.value(f"fsub {writer.type} {count}, {writer.number(1.0)}")
    begin = lanes.begin(some, left, width)
    for name in pop.rows:
        writer.fill_with_nan(name)
    lanes.move(writer.functions.text("stack.get", _get_text), pop.stack, begin, pop.rows)
    lanes.count(pop.count, some, left)


class _Lanes:
    """Text over lanes, in some of which a condition holds."""

    def __init__(self, writer: Writer) -> None:
        self._writer, self._bits = writer, f"<{writer.functions.arithmetic.lanes} x i1>"

    def both(self, *comparisons: tuple[str, str, float]) -> str:
        """In which lanes two comparisons hold."""
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

    def move(self, function: str, stack: str, begin: str, names: Names) -> None:
        """Between rows of the stack and registers, end to end."""
        writer, at = self._writer, 0
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


def _put_text(arithmetic: Arithmetic) -> list[str]:
    """`void stack.put(stack, begin, row, at, n)`: stack[begin + at + j] = row[j] in lanes where begin >= 0."""
    return _move_text(arithmetic, "stack.put")


def _get_text(arithmetic: Arithmetic) -> list[str]:
    """`void stack.get(stack, begin, row, at, n)`: row[j] = stack[begin + at + j] in lanes where begin >= 0."""
    return _move_text(arithmetic, "stack.get")


def _move_text(arithmetic: Arithmetic, name: str) -> list[str]:
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
