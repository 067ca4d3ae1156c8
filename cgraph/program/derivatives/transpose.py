"""Cotangents: programs that pull y_bar back to J^T y_bar along what passes record; and the tape of that record."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

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
from ..statement import Lengths, Statement, effects, graphs_of, length_of, needed, reads_and_writes, row_of
from ..statements.call import Call, added, copied
from ..statements.rows import For
from .jvp import Assignment, Linearized, Numbers, Passes, Product, Registers, nonzero, rule_of, split, statements_of

HEAVY_GRAPH = 4  # operations of a graph for each of its outputs, from which on these are kept and not computed again
TAPE_BLOCK = 4096  # passes in a block of a tape
Pullback = Callable[[Sequence[Node]], Graph]  # a graph's own rule: cotangents of these inputs, see `cotangent_graph`
Values = Mapping[str, Array]  # of registers
Block = tuple[int, int, Array]  # passes first .. last - 1, and the rows of their record, or the memory before them
Given = Mapping[str, ArrayLike]  # the same, of a user
Feed = Callable[[int, int], Array]  # what passes first .. last - 1 are fed, (passes, width, N), or one for all
Rules = Mapping[int, tuple[int, Pullback]]  # by the id of a graph; and how many of its first outputs have cotangents


@kept_by_first
def cotangent_graph(
    graph: Graph, rule: Pullback | None, inputs: Numbers, wanted: Numbers, outputs: Numbers, seeded: Numbers
) -> Product:
    """Cotangents of the inputs `wanted`, over the graph's inputs, by a rule also its outputs, and those of `seeded`."""
    groups = split(graph.inputs, inputs)
    by = [node for k in wanted for node in groups[k]]
    if rule is None:
        names = split(list(graph.outputs), outputs)
        made = simplify(vjp(Graph(graph.inputs, {name: graph.outputs[name] for k in seeded for name in names[k]}), by))
    else:
        made = rule(by)
    results = split(list(made.outputs.values()), [len(groups[k]) for k in wanted])
    return nonzero(made.inputs, dict(zip(wanted, results, strict=True)))


@dataclass
class Adjoint(Registers):
    """The statements that pull cotangents back through assignments.  bars: {register: the one of its cotangent}."""

    bars: dict[str, str]
    rules: Rules
    _after: frozenset[str] = field(init=False)  # of what comes after the assignments, which stay as they are

    def __post_init__(self) -> None:
        self._after = frozenset(self.bars.values())

    def pull(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the last first."""
        for assignment in reversed(assignments):
            rule_of(assignment.statement, "transpose")(assignment, self)

    def bar(self, register: str) -> str:
        """A new register for a cotangent of one."""
        return self.fresh(f"{register}_bar", self.lengths[register])

    def collect(self, register: str, bar: str) -> None:
        """Add a term to a register's cotangent."""
        if register not in self.bars:
            self.bars[register] = bar
            return
        before = self.bars[register]
        self.bars[register] = after = self.bar(register) if before in self._after else before
        self.add(added(before, bar, after))


def _recovery(assignments: Sequence[Assignment], values: Iterable[str]) -> tuple[list[Statement], list[str], set[str]]:
    """Statements that compute values again, registers of a record of heavy ones, and what both begin with."""
    wanted, tape, again = set(values), dict[str, None](), list[Statement]()
    for assignment in reversed(assignments):
        run = assignment.statements
        for group in [*[(each,) for each in reversed(assignment.unrun)], run]:
            here = [name for name in reads_and_writes(group[-1])[1] if name in wanted]
            if here and group is run and _is_heavy(group[-1]):
                tape |= dict.fromkeys(here)
                wanted -= set(here)
            elif here:
                again = [*group, *again]
                wanted |= set(effects(group)[0])
    return again, list(tape), wanted


def _is_heavy(statement: Statement) -> bool:
    if isinstance(statement, Call | For):
        graphs = graphs_of(statement)
        size = sum([1 for graph in graphs for node in graph.nodes if node.args])
        return size > HEAVY_GRAPH * sum([len(graph.outputs) for graph in graphs])
    return bool(row_of(statement).bodies)


def adjoint(passes: Passes, seeds: Sequence[str], rules: Rules = MappingProxyType({})) -> Linearized:
    """A pass, fed the record backwards, that pulls cotangents of `seeds` and inputs; it records those of `varied`."""
    handed, outer = passes.handed, Adjoint(dict(passes.lengths), passes.own, passes.active, {}, rules)
    bars, more = dict[str, str](), [*dict.fromkeys(seeds)]
    while True:  # until there are those of all registers that these come from
        bars |= {name: outer.bar(name) for name in more}
        inner = replace(outer, bars={handed[name]: bar for name, bar in bars.items()})
        inner.pull(passes.plain)
        more = [name for name in handed if name in inner.bars and name not in bars and name in passes.active]
        if not more:
            break
    sums, rows = ({name: outer.bar(name) for name in names} for names in (passes.inputs, passes.varied))
    inner.add(*[added(end, inner.bars[name], end) for name, end in sums.items() if name in inner.bars])
    inner.add(*[copied(inner.bars.get(name), end) for name, end in {**bars, **rows}.items()])
    return _along(passes, inner, bars | sums, [*rows.values()])


def tangent(passes: Passes, record: Sequence[str], then: Sequence[Statement] = ()) -> Linearized:
    """A pass, fed the record, that pushes tangents, {name}:dot, and then runs more; it records those of `record`."""
    made, dots = passes.tangents()
    made.add(*then)
    return _along(passes, made, dots, [dots[name] for name in record])


def _along(passes: Passes, made: Registers, vectors: Mapping[str, str], record: Sequence[str]) -> Linearized:
    """The statements that were made, after those that compute what they need of a pass from what was recorded of it."""
    linear = needed(made.statements, {*vectors.values(), *record, made.unsolved})
    again, tape, wanted = _recovery(passes.plain, effects(linear)[0])
    feed = [*[name for name in (*passes.fed, *passes.handed) if name in wanted], *tape]
    program = passes.program(made, [*again, *linear], record, feed, {*vectors.values(), *passes.constants})
    return Linearized(program, vectors, made.unsolved)


class Along:
    """Passes that record, and a program that goes along their record, ready to run.

    results: registers that are read after all passes.  more: those recorded after what the derivative is fed. The start
    is put in the registers of `handed` after a pass, where each pass begins.
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


class Tape:
    """A run of passes, of N memories side by side, with what is recorded for its derivative, in blocks.

    values: {register: (k,), or (k, N), before the first pass}, 0 of others.  checkpoints: passes between two memories
    from which the record is made again; 0: the record is kept.  every: record only after each so many passes.
    """

    def __init__(
        self, of: Along, values: Values, feed: Feed, many: int = 1, checkpoints: int = 0, every: int = 1
    ) -> None:
        self.of, self.feed, self.checkpoints, self.every = of, feed, checkpoints, every
        start = {of.passes.handed.get(name, name): value for name, value in values.items()}
        self.memory, self.blocks = _memory(of.forward, start, many), list[Block]()
        self.first = self.memory.copy()

    def run(self, begin: int, end: int) -> None:
        """Passes begin .. end - 1."""
        size = self.checkpoints or max(1, TAPE_BLOCK // self.every) * self.every
        for first in range(begin, end, size):
            last = min(first + size, end)
            before, part = self.memory.copy(), last - first if self.checkpoints else self.every
            rows = run_passes(self.of.forward, self.memory, last - first, part, self.feed(first, last))
            self.blocks.append((first, last, before if self.checkpoints else rows))

    def records(self, *, backwards: bool) -> Iterator[Block]:
        """The blocks with the rows of every pass, (passes, width, N), from the last one back if asked."""
        for first, last, kept in reversed(self.blocks) if backwards else self.blocks:
            rows = kept
            if self.checkpoints:
                rows = run_passes(self.of.forward, kept.copy(), last - first, 1, self.feed(first, last))
            yield first, last, rows

    def value(self, name: str, memory: Array | None = None) -> Array:
        """A register after the passes, or in other memories of theirs, (k, N)."""
        name = self.of.passes.handed.get(name, name)
        return self.of.forward.read(self.memory if memory is None else memory, name).copy()

    def derivative_memory(self, vectors: Values, many: int) -> Array:
        """Memories of the derivative, with these vectors of the registers that have one."""
        names = self.of.linear.vectors
        values = {name: self.value(name) for name in self.of.passes.constants}
        values |= {names[name]: vector for name, vector in vectors.items() if name in names}
        return _memory(self.of.derivative, values, many)

    def vectors(self, memory: Array) -> tuple[dict[str, Array], Array]:
        """The vectors in memories of the derivative, (k, N), and whether equations were not solved, (N,)."""
        read, linear = self.of.derivative.read, self.of.linear
        return {name: read(memory, at).copy() for name, at in linear.vectors.items()}, read(memory, linear.unsolved)[0]

    def cotangents(self, seeds: Values) -> tuple[dict[str, Array], Array, Array]:
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


def _memory(ready: Runner, values: Values, many: int) -> Array:
    """Memories with those of the values, (k, N) or for all (k,), that the program has registers for."""
    memory = ready.memory({}, many)
    for name, numbers in values.items():
        if name in ready.program.registers:
            ready.read(memory, name)[...] = numbers[:, None] if numbers.ndim == 1 else numbers
    return memory


def program_vjp(
    program: Program, of: Sequence[str], wrt: Sequence[str] = (), *, constant: Sequence[str] = (), backend: str = "auto"
) -> Callable[..., tuple[dict[str, Array], dict[str, Array]]]:
    """Cotangents through any number of passes of a program: J^T y_bar of what its registers hold after the last one.

    program, wrt, constant: as for `program_jvp`; what it records does not matter.  of: registers whose values after the
    last pass are the result.  backend: as for `runner`.
    Returns a function `pull(values, passes, seeds, feed=None)` of {register: value before the first pass}, 0 for
    others, the number of passes, {register of `of`: cotangent after the last one}, 0 for others, and the feed, (passes,
    feed_width). It gives {register of `of`: value after the last pass}, and {register: cotangent} of what is handed on
    and of `wrt`; of a register that is fed (passes, length).
    Raises GraphError for unknown registers or other shapes, and where equations of a `FixedPoint` were not solved;
    TypeError for a statement without derivative.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, program_vjp
    >>> x, p = cg.variables("x p")
    >>> step = Program({"x": 1, "p": 1}, [Call(cg.Graph([x, p], {"x": p * x}), ("x", "p"), ("x",))], record=["x"])
    >>> pull = program_vjp(step, ["x"], ["p"])
    >>> values, bars = pull({"x": 2.0, "p": 3.0}, passes=2, seeds={"x": 1.0})
    >>> values["x"].tolist(), bars["x"].tolist(), bars["p"].tolist()
    ([18.0], [9.0], [12.0])
    """
    passes = Passes(program, of, wrt, constant)
    return partial(_pulled, Along(passes, adjoint(passes, of), of, backend), list(of))


def _pulled(
    along: Along, of: Sequence[str], values: Given, passes: int, seeds: Given, feed: ArrayLike | None = None
) -> tuple[dict[str, Array], dict[str, Array]]:
    """The function that `program_vjp` returns."""
    rows, lengths = np.empty((require_whole("passes", passes, 1), 0)), along.forward.program.registers
    rows = rows if feed is None else real_array("feed", feed)
    if rows.ndim != 2 or len(rows) != passes:
        raise GraphError(f"the feed needs a row for each of {passes} passes, got shape {rows.shape}")
    shared = along.forward.program.shared
    own = {name: n for name, n in lengths.items() if along.passes.own not in name and name not in shared}
    start, after = _numbers("values", values, own), _numbers("seeds", seeds, {name: own[name] for name in of})
    tape = Tape(along, start, lambda first, last: rows[first:last, :, None])
    tape.run(0, passes)
    bars, slopes, unsolved = tape.cotangents(after)
    if unsolved[0]:
        raise GraphError("the derivative of a FixedPoint was not solved: its turns do not settle")
    found, at = {name: bar[:, 0] for name, bar in bars.items()}, 0
    for name in along.passes.varied:
        found[name] = slopes[:, at : at + own[name], 0]
        at += own[name]
    return {name: tape.value(name)[:, 0] for name in of}, found


def _numbers(what: str, values: Given, lengths: Lengths) -> dict[str, Array]:
    """Values of registers as arrays. Raises GraphError for an unknown one, or a value of another length."""
    found = {}
    for name, value in require_mapping(what, values, "register: numbers").items():
        wanted, numbers = length_of(lengths, what, name), real_array(f"{what}[{name!r}]", value)
        if numbers.shape not in ((), (wanted,)):
            raise GraphError(f"{what}[{name!r}] needs shape ({wanted},), got {numbers.shape}")
        found[name] = np.broadcast_to(numbers, (wanted,))
    return found
