"""Cotangents: programs that pull y_bar back to J^T y_bar along what passes record; and the tape of that record."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...autodiff.products import vjp
from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...core.graph import Graph
from ...core.node import Node
from ...simplification.simplify import simplify
from ...util.caches import kept_by_first
from ...util.require import require_mapping, require_whole
from ..program import Program
from ..runners.native_runner import runner
from ..runners.runner import Runner
from ..statement import Statement, effects, needed, reads_and_writes, row_of
from ..statements.call import Call, added, copied, copied_or_zero
from .jvp import Assignment, Linearized, Numbers, Passes, Product, Registers, nonzero, split, statements_of

HEAVY_GRAPH = 4  # operations of a graph for each of its outputs, from which on these are kept and not computed again
TURNS = 64  # of a loop that its stack has room for, unless more are asked for
TAPE_BLOCK = 4096  # passes in a block of a tape
Pullback = Callable[[Sequence[Node]], Graph]  # a graph's own rule: cotangents of these inputs, see `cotangent_graph`
Rules = Mapping[int, tuple[int, Pullback]]  # by the id of a graph; and how many of its first outputs have cotangents


@kept_by_first
def cotangent_graph(
    graph: Graph, rule: Pullback | None, inputs: Numbers, wanted: Numbers, outputs: Numbers, seeded: Numbers
) -> Product:
    """Cotangents of the inputs `wanted` from those of the outputs `seeded`. Inputs of the graph: its own, cotangents.

    rule: one of the graph's own, whose graph has the values of all outputs for inputs, too, before the cotangents.
    """
    groups = split(graph.inputs, inputs)
    by = [node for k in wanted for node in groups[k]]
    if rule is None:
        names = split(list(graph.outputs), outputs)
        made = simplify(vjp(Graph(graph.inputs, {name: graph.outputs[name] for k in seeded for name in names[k]}), by))
    else:
        made = rule(by)
    results = split(list(made.outputs.values()), [len(groups[k]) for k in wanted])
    return nonzero(made.inputs, dict(zip(wanted, results, strict=True)))


class Adjoint(Registers):
    """The statements that pull cotangents back through assignments.

    bars: {register: the one that has its cotangent}, of what comes after, which stay as they are; the rules extend it.
    active: registers that depend on what moves.  rules: of graphs that a `Call` has.
    """

    def __init__(
        self, bars: Mapping[str, str], active: Set[str], lengths: dict[str, int], own: str, rules: Rules
    ) -> None:
        super().__init__(lengths, own)
        self.bars, self.active, self.rules, self._kept = dict(bars), active, rules, set(bars.values())

    def inner(self, bars: Mapping[str, str]) -> Adjoint:
        """Adjoint of a body, from cotangents of its end."""
        return Adjoint(bars, self.active, self.lengths, self.own, self.rules)

    def pull(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the last first."""
        for assignment in reversed(assignments):
            row = row_of(assignment.statement)
            if row.transpose is None:
                raise TypeError(f"a {row.kind.__name__} has no cotangents: its row has no `transpose`")
            row.transpose(assignment, self)

    def bar(self, register: str) -> str:
        """A new register for a cotangent of one."""
        return self.fresh(f"{register}_bar", self.lengths[register])

    def collect(self, register: str, bar: str) -> None:
        """Add a term to a register's cotangent."""
        if register not in self.bars:
            self.bars[register] = bar
            return
        before = self.bars[register]
        self.bars[register] = after = self.bar(register) if before in self._kept else before
        self.add(added(before, bar, after))


def recovery(
    assignments: Sequence[Assignment], values: Iterable[str], *, light: bool = True
) -> tuple[list[Statement], list[str], set[str]]:
    """How values that assignments computed come back: statements, registers of a record, and what both begin with.

    Results of heavy statements are recorded, others are made again; if not only the `light` ones, all.
    """
    wanted, tape, again = set(values), dict[str, None](), list[Statement]()
    for assignment in reversed(assignments):
        run = assignment.statements
        for group in [*[(each,) for each in reversed(_unrun(assignment))], run]:
            here = [name for name in reads_and_writes(group[-1])[1] if name in wanted]
            if here and light and group is run and _is_heavy(group[-1]):
                tape |= dict.fromkeys(here)
                wanted -= set(here)
            elif here:
                again = [*group, *again]
                wanted |= set(effects(group)[0])
    return again, list(tape), wanted


def _unrun(assignment: Assignment) -> list[Statement]:
    """Statements that the passes do not run: of iterations, also inside others, one more turn."""
    if assignment.carried:
        return statements_of(assignment.parts[0])
    return [statement for part in assignment.parts for each in part for statement in _unrun(each)]


def _is_heavy(statement: Statement) -> bool:
    if not isinstance(statement, Call):
        return bool(row_of(statement).bodies)
    graph = statement.graph
    return sum(1 for node in graph.nodes if node.args) > HEAVY_GRAPH * len(graph.outputs)


def adjoint(passes: Passes, seeds: Sequence[str], rules: Rules = MappingProxyType({})) -> Linearized:
    """A pass that pulls cotangents back, of what it hands on, `seeds` among it, and of its inputs.

    It is fed what was recorded, the last pass first, and records the cotangents of `varied`.  rules: of graphs.
    """
    handed, outer = passes.handed, Adjoint({}, passes.active, dict(passes.lengths), passes.own, rules)
    bars: dict[str, str] = {}
    more = [*dict.fromkeys(seeds)]
    while True:  # until there are those of all registers that these come from
        bars |= {name: outer.bar(name) for name in more}
        inner = outer.inner({handed[name]: bar for name, bar in bars.items()})
        inner.pull(passes.plain)
        more = [name for name in handed if name in inner.bars and name not in bars and name in passes.active]
        if not more:
            break
    sums, rows = ({name: outer.bar(name) for name in names} for names in (passes.inputs, passes.varied))
    inner.add(*[added(end, inner.bars[name], end) for name, end in sums.items() if name in inner.bars])
    inner.add(*[copied_or_zero(inner.bars.get(name), end) for name, end in {**bars, **rows}.items()])
    return _along(passes, inner, bars | sums, [*rows.values()])


def tangent(passes: Passes, record: Sequence[str], then: Sequence[Statement] = ()) -> Linearized:
    """A pass that pushes tangents on, of what it hands on and of all by which derivatives are taken.

    It is fed what was recorded, and records the tangents of `record` after a pass.  then: what else it does with
    the tangents, {name}:dot.
    """
    made, dots = passes.tangents([*passes.inputs, *passes.varied], values=False)
    made.add(*then)
    return _along(passes, made, dots, [dots[name] for name in record])


def _along(passes: Passes, made: Registers, vectors: Mapping[str, str], record: Sequence[str]) -> Linearized:
    """The statements that were made, after those that compute what they need of a pass from what was recorded of it."""
    linear = needed(made.statements, {*vectors.values(), *record, made.unsolved})
    again, tape, wanted = recovery(passes.plain, effects(linear)[0])
    feed = [*[name for name in (*passes.fed, *passes.handed) if name in wanted], *tape]
    program = passes.program(made, [*again, *linear], record, feed, {*vectors.values(), *passes.constants})
    return Linearized(program, vectors, made.unsolved)


class Along:
    """Passes that record, and a program that goes along their record, ready to run.

    results: registers that are read when all passes are done.  more: registers that are recorded besides, after what
    the linearized program is fed. A pass begins with what the one before handed on, in the registers of `handed` after
    it: the start is put there.
    """

    def __init__(
        self, passes: Passes, linear: Linearized, results: Sequence[str], backend: str, more: Sequence[str] = ()
    ) -> None:
        handed, record = passes.handed, [*linear.program.feed, *more]
        ends = [handed.get(name, name) for name in results]
        body = needed(statements_of(passes.plain), {*handed.values(), *ends, *record})
        begin = [copied(after, before) for before, after in handed.items() if passes.lengths[before]]
        own = [name for name in passes.lengths if passes.own not in name]
        forward = passes.program(passes, [*begin, *body], record, passes.fed, [*ends, *own])
        self.passes, self.linear = passes, linear
        self.forward, self.derivative = runner(forward, backend), runner(linear.program, backend)


class Block(NamedTuple):
    """Passes first .. last - 1, and what is kept of them: the rows of their record, or the memory before them."""

    first: int
    last: int
    kept: Array


class Tape:
    """A run of passes, of N memories side by side, with what is recorded for its derivative, in blocks.

    values: {register: (k,), or (k, N), before the first pass}; of those that there are, 0 of others.
    feed: (first, last) -> what the passes first .. last - 1 are fed, (passes, width, N), or one for all.
    checkpoints: passes between two memories from which the record is made again; 0: the record is kept.
    every: record only after each so many passes.
    """

    def __init__(
        self,
        of: Along,
        values: Mapping[str, Array],
        feed: Callable[[int, int], Array],
        many: int = 1,
        checkpoints: int = 0,
        every: int = 1,
    ) -> None:
        self.of, self.feed, self.checkpoints, self.every = of, feed, checkpoints, every
        handed = of.passes.handed
        self.memory = _memory(of.forward, {handed.get(name, name): value for name, value in values.items()}, many)
        self.first, self.blocks = self.memory.copy(), list[Block]()

    def run(self, begin: int, end: int) -> None:
        """Passes begin .. end - 1."""
        size = self.checkpoints or max(1, TAPE_BLOCK // self.every) * self.every
        for first in range(begin, end, size):
            last = min(first + size, end)
            before = self.memory.copy() if self.checkpoints else None
            part = last - first if self.checkpoints else self.every
            rows = run_passes(self.of.forward, self.memory, last - first, part, self.feed(first, last))
            self.blocks.append(Block(first, last, rows if before is None else before))

    def records(self, *, backwards: bool) -> Iterator[Block]:
        """The blocks with the rows of every pass, (passes, width, N), from the last one back if asked."""
        for block in reversed(self.blocks) if backwards else self.blocks:
            first, last, kept = block
            if self.checkpoints:
                rows = run_passes(self.of.forward, kept.copy(), last - first, 1, self.feed(first, last))
            yield Block(first, last, rows) if self.checkpoints else block

    def value(self, name: str, memory: Array | None = None) -> Array:
        """A register after the passes, or in other memories of theirs, (k, N)."""
        name = self.of.passes.handed.get(name, name)
        return self.of.forward.read(self.memory if memory is None else memory, name).copy()

    def derivative_memory(self, vectors: Mapping[str, Array], many: int) -> Array:
        """Memories of the derivative, with these vectors of the registers that have one."""
        names = self.of.linear.vectors
        values = {name: self.value(name) for name in self.of.passes.constants}
        values |= {names[name]: vector for name, vector in vectors.items() if name in names}
        return _memory(self.of.derivative, values, many)

    def vectors(self, memory: Array) -> tuple[dict[str, Array], Array]:
        """The vectors in memories of the derivative, (k, N), and whether equations were not solved, (N,)."""
        read, linear = self.of.derivative.read, self.of.linear
        return {name: read(memory, at).copy() for name, at in linear.vectors.items()}, read(memory, linear.unsolved)[0]

    def cotangents(self, seeds: Mapping[str, Array]) -> tuple[dict[str, Array], Array, Array]:
        """Cotangents before the passes, of those after them; the record, (passes, width, N); and what is unsolved."""
        ready, memory, parts = self.of.derivative, self.derivative_memory(seeds, self.memory.shape[1]), []
        for first, last, rows in self.records(backwards=True):
            fed = rows[::-1, : ready.program.feed_width]
            parts.append(run_passes(ready, memory, last - first, 1, fed)[::-1])
        bars, unsolved = self.vectors(memory)
        return bars, np.concatenate(parts[::-1]), unsolved


def run_passes(ready: Runner, memory: Array, passes: int, every: int, feed: Array) -> Array:
    """The rows, (passes, width, N), of passes of N memories side by side."""
    one, shape = memory.shape[1] == 1, (passes // every, ready.program.width, memory.shape[1])
    with np.errstate(all="ignore"):
        record = ready.run(memory[:, 0] if one else memory, passes, every, feed[:, :, 0] if one else feed)
    return record.rows.reshape(shape)


def _memory(ready: Runner, values: Mapping[str, Array], many: int) -> Array:
    """Memories with those of the values, (k, N) or for all (k,), that the program has registers for."""
    memory = ready.memory({}, many)
    for name, numbers in values.items():
        if name in ready.program.registers:
            ready.read(memory, name)[...] = numbers[:, None] if numbers.ndim == 1 else numbers
    return memory


class Pulled(NamedTuple):
    """Values at the end of passes, and cotangents at their start.

    values: {register of `of`: its value after the last pass}.  bars: {register: its cotangent} of what is handed on and
    of `wrt`.  rows: {register of the feed in `wrt`: its cotangents, (passes, length)}.

    >>> from cgraph.extend import Program, program_vjp
    >>> program_vjp(Program({"x": 1}, [], record=()), ["x"])({"x": 2.0}, 1, {"x": 3.0}).bars
    {'x': array([3.])}
    """

    values: dict[str, Array]
    bars: dict[str, Array]
    rows: dict[str, Array]


class ProgramVjp:
    """J^T y_bar of any number of passes of a program; made by `program_vjp`.

    forward: runs the passes, which record what their way back reads; what is handed on begins and ends in the registers
    `handed`, {register: the one that has its value after a pass}.  backward: runs a pass backwards, fed a row of that
    record, and has cotangents in the registers `vectors`, {register: that of its cotangent}.

    >>> from cgraph.extend import Program, program_vjp
    >>> pull = program_vjp(Program({"x": 1}, [], record=()), ["x"])
    >>> pull({"x": 2.0}, passes=5, seeds={"x": 3.0}).bars["x"].tolist()
    [3.0]
    """

    def __init__(self, passes: Passes, of: Sequence[str], backend: str, checkpoints: int) -> None:
        self._along = Along(passes, adjoint(passes, of), of, backend)
        self._of, self._checkpoints = of, checkpoints
        self.handed, self.vectors = dict(passes.handed), dict(self._along.linear.vectors)
        self.forward, self.backward = self._along.forward, self._along.derivative

    def __call__(
        self,
        values: Mapping[str, ArrayLike],
        passes: int,
        seeds: Mapping[str, ArrayLike],
        feed: ArrayLike | None = None,
    ) -> Pulled:
        """Run at least one pass from values of registers, and pull cotangents of `of` back through them.

        values: {register: value before the first pass}, 0 for others.  seeds: {register of `of`: cotangent after the
        last pass}, 0 for others.  feed: (passes, feed_width), as for `Runner.run`.
        Raises GraphError for unknown registers or other shapes, where equations of a `FixedPoint` were not solved, and
        for a loop that takes more turns than there is room for.
        """
        require_whole("passes", passes, 1)
        rows = np.empty((passes, 0)) if feed is None else real_array("feed", feed)
        if rows.ndim != 2 or len(rows) != passes:
            raise GraphError(f"the feed needs a row for each of {passes} passes, got shape {rows.shape}")
        lengths, inner = self.forward.program.registers, {*self.handed.values()}
        own, start, bars_after = [name for name in lengths if name not in inner], dict[str, Array](), dict[str, Array]()
        for what, given, known, to in (("values", values, own, start), ("seeds", seeds, self._of, bars_after)):
            for name, numbers in require_mapping(what, given, "register: numbers").items():
                if name not in known:
                    raise GraphError(f"{what} must be of registers among {', '.join(known)}, got {name!r:.60}")
                to[name] = real_array(f"{what}[{name!r}]", numbers)
                if to[name].shape not in ((), (lengths[name],)):
                    raise GraphError(f"{what}[{name!r}] needs shape ({lengths[name]},), got {to[name].shape}")
        tape = Tape(self._along, start, lambda first, last: rows[first:last, :, None], checkpoints=self._checkpoints)
        tape.run(0, passes)
        bars, slopes, unsolved = tape.cotangents(bars_after)
        if np.isnan(unsolved[0]):
            turns = self._along.passes.turns
            raise GraphError(f"a loop took more turns than the {turns} there is room for: give turns=")
        if unsolved[0]:
            raise GraphError("the derivative of a FixedPoint was not solved: its turns do not settle")
        by_pass, at = dict[str, Array](), 0
        for name in self._along.passes.varied:
            by_pass[name] = slopes[:, at : at + lengths[name], 0]
            at += lengths[name]
        ends = {name: tape.value(name)[:, 0] for name in self._of}
        return Pulled(ends, {name: bar[:, 0] for name, bar in bars.items()}, by_pass)


def program_vjp(
    program: Program,
    of: Sequence[str],
    wrt: Sequence[str] = (),
    *,
    constant: Sequence[str] = (),
    turns: int = TURNS,
    checkpoints: int = 0,
    backend: str = "auto",
) -> ProgramVjp:
    """Cotangents through any number of passes of a program: J^T y_bar of what its registers hold after the last one.

    The passes record the results of their heavy graphs and what they begin with; on the way back the rest is computed
    again. A loop inside a pass records its turns on a stack.

    program, wrt, constant: as for `program_jvp`; what it records does not matter.  of: registers whose values after the
    last pass are the result.  turns: for how many turns of a `While` there is room.  checkpoints: keep the memory after
    every so many passes, and record again from there; 0: keep the record of all.
    backend: as for `runner`.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, program_vjp
    >>> x, p = cg.variables("x p")
    >>> step = Program({"x": 1, "p": 1}, [Call(cg.Graph([x, p], {"x": p * x}), ("x", "p"), ("x",))], record=["x"])
    >>> pulled = program_vjp(step, ["x"], ["p"])({"x": 2.0, "p": 3.0}, passes=2, seeds={"x": 1.0})
    >>> pulled.values["x"].tolist(), pulled.bars["x"].tolist(), pulled.bars["p"].tolist()
    ([18.0], [9.0], [12.0])
    """
    passes = Passes(program, of, wrt, constant, require_whole("turns", turns, 1))
    return ProgramVjp(passes, list(of), backend, require_whole("checkpoints", checkpoints))
