"""Step: one step of a method as formulas over registers, of which equal and chosen steps and derivatives are made."""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import reduce
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import CompressedJacobian, kept_by_first
from cgraph.extend import (
    STATEMENTS,
    Call,
    Factor,
    FixedPoint,
    For,
    Map,
    Statement,
    Sum,
    While,
    compressed_jacobian,
    copied,
    effects,
)

from .problem import Problem, state_jacobian

# What a step may read of a run; in equal steps and derivatives, which have no tolerance, the others are 0.
STATES = ("x", "x_new", "atol")
SHARED = (*STATES, *"t h p rtol leap next end evaluations error at_limit accepted".split())
Values = Mapping[str, Node | float | Sequence[Node | float]]
Rule = Callable[..., Values]
Formula = tuple[Graph, tuple[str, ...], tuple[str, ...]]
Weights = Sequence[float | Fraction]


@dataclass(frozen=True, eq=False)
class Step:
    """One step of a method, from registers x (m), t, h and p to x_new (m); docs/extending.md tells of each field."""

    lengths: Mapping[str, int] = field(default_factory=dict)  # of registers that a `Call` of several sets
    body: Sequence[Statement] = ()  # x_new of x, t, h, p and what comes before
    rates: Sequence[Statement] = ()  # before all else, from x, t and p
    prepare: Sequence[Statement] = ()  # after `rates`, once for a state, whatever lengths are tried from it
    start: Sequence[Statement] = ()  # before the first step
    kept: Sequence[Statement] = ()  # after an accepted step, with x still the old state: what the next may guess by
    fixed: tuple[str, ...] = ()  # registers without derivatives: guesses, roundings, matrices of an iteration
    failed: str = ""  # the register that is not 0 after a step whose equations were not solved
    error: Sequence[Statement] = ()  # after the body: register `error`, 1 at the tolerance, see `measured`
    estimate: int = 0  # q, where the estimate falls as h^q
    handed: Sequence[Statement] | None = None  # after an accepted chosen step, in place of the next one's `rates`
    dense: Sequence[Statement] = ()  # after an accepted one: dense1, dense2, ..: x(t + s h) = x + sum_k dense_k s^k

    @property
    def derived(self) -> list[Statement]:
        """The statements from x to the new x, whose derivatives are taken."""
        *before, last = (*self.rates, *self.prepare, *self.body, *self.kept)
        if isinstance(last, Map | Call) and last.outputs == ("x_new",):
            return [*before, replace(last, outputs=("x",))]
        return [*before, last, copied("x_new", "x")]

    @property
    def iterates(self) -> bool:
        """Whether the step iterates as often as numbers say, so that steps side by side wait for one another."""
        return any(isinstance(each, While | FixedPoint) for each in (*self.start, *self.derived))


def with_registers(step: Step, own: Mapping[str, int], *more: Statement) -> dict[str, int]:
    """Lengths of all registers: those of what wraps a step, and its own.  more: statements after its body."""
    every = [*step.start, *step.rates, *step.prepare, *step.body, *more, *step.kept]
    written = effects([*step.rates, *step.prepare, *step.body, *step.kept])[1]
    if "x_new" not in written or "x" in written:
        raise ValueError("a step has to write register 'x_new', and to leave 'x' as it is")
    reads, writes = effects(every)
    if twice := [name for name in (*step.lengths, *writes) if name in own and name not in SHARED]:
        raise ValueError(f"a step cannot have a register {twice[0]!r}: a run has another of that name")
    shared = {name: own["x"] if name in STATES else 1 for name in SHARED if name not in own}
    lengths = dict.fromkeys(step.fixed, 1) | lengths_of(every, {**shared, **step.lengths, **own})
    return {name: lengths[name] for name in (*step.lengths, *reads, *writes, *step.fixed, *own) if name in lengths}


def rate_calls(problem: Problem, *statements: Sequence[Statement]) -> int:
    """Number of times that statements evaluate the rate; those inside an iteration count themselves."""
    called = problem.evaluation.called
    return sum(isinstance(each, Call) and each.graph is called for part in statements for each in part)


def call(rule: Rule, *reads: str, **lengths: int) -> Call:
    """Statement that sets registers by a rule of others: a function of nodes that gives {register: node}.

    Its parameters are the registers that it reads (an underscore at the end is dropped), unless `reads` names them; of
    these, one that no result depends on is left out.  lengths: of those that are lists of several numbers.

    >>> later = call(lambda t, h: {"t_new": t + h})
    >>> later.inputs, later.outputs
    (('t', 'h'), ('t_new',))
    """
    return Call(*_formula(rule, reads, lengths))


def each(rule: Rule, *reads: str) -> Map:
    """Statement that sets registers by a rule of others, see `call`, component by component."""
    return Map(*_formula(rule, reads, {}))


def total(rule: Rule, *reads: str) -> Sum:
    """Statement that sets registers to the sums over all components of a rule of others, see `call`."""
    return Sum(*_formula(rule, reads, {}))


def _formula(rule: Rule, reads: tuple[str, ...], lengths: Mapping[str, int]) -> Formula:
    """The graph of a rule, and the registers that it reads and sets."""
    names = reads or tuple([name.rstrip("_") for name in inspect.signature(rule).parameters])
    values: list[Any] = [
        cg.variables([f"{name}[{k}]" for k in range(lengths[name])]) if name in lengths else cg.variable(name)
        for name in names
    ]
    results = rule(*values)
    graph = Graph(_end_to_end(values), {f"{k}": number for k, number in enumerate(_end_to_end(results.values()))})
    if reads and not lengths and not {*graph.inputs} <= (within := {*graph.nodes}):
        names = tuple([name for name, value in zip(names, values, strict=True) if value in within])
        graph = Graph([value for value in values if value in within], graph.outputs)
    return graph, names, tuple(results)


def _end_to_end(values: Iterable[Any]) -> list[Any]:
    return [number for value in values for number in (value if isinstance(value, list) else [value])]


def lengths_of(statements: Iterable[Statement], known: Mapping[str, int]) -> dict[str, int]:
    """Lengths of the registers that statements set, as far as these and those that are known tell."""
    lengths = dict(known)
    for statement in _inside(statements):
        told: dict[str, int] = {}
        if isinstance(statement, Factor):
            told[statement.pivots] = math.isqrt(lengths.get(statement.matrix, 0))
        elif isinstance(statement, Call | Map | Sum):
            names, numbers, elements = statement.outputs, len(statement.graph.outputs), 1
            if isinstance(statement, Map):
                elements = max([lengths.get(name, 1) for name in statement.inputs], default=1)
            unknown = [name for name in names if name not in known]
            if len(names) == numbers:
                told = dict.fromkeys(unknown, elements)
            elif len(unknown) == 1:
                told[unknown[0]] = elements * numbers - sum([known[name] for name in names if name in known])
        elif isinstance(statement, For):  # of a rate
            told = {name: lengths["x"] for name in statement.changed if name not in known}
        lengths |= {name: max(length, lengths.get(name, 0)) for name, length in told.items()}
    return lengths


def _inside(statements: Iterable[Statement]) -> Iterator[Statement]:
    for statement in statements:
        yield statement
        for body in STATEMENTS[type(statement)].bodies:
            yield from _inside(getattr(statement, body))


def jacobian_statements(problem: Problem) -> list[Statement]:
    """df/dx of the registers x, t and p to the register "jacobian", row by row, written out or by colors."""
    parts = _compressed(problem)
    if parts is None:
        return [Call(state_jacobian(problem), ("x", "t", "p"), ("jacobian",))]
    rows = tuple(numbered("jacobian", problem.size))
    return [
        Call(parts.primal, ("x", "t", "p"), ("known",)),
        call(lambda: {"color": [float(k) for k in range(parts.colors)]}),
        Map(parts.product, ("color",), rows, shared=("known",)),
        Call(parts.entries, rows, ("jacobian",)),
    ]


@kept_by_first
def _compressed(problem: Problem) -> CompressedJacobian | None:
    return compressed_jacobian(problem.rate, list(problem.states))


def identity(m: int) -> Call:
    """Register `unit` = the identity matrix, row by row."""
    return call(lambda: {"unit": [float(row == column) for row in range(m) for column in range(m)]})


def weighted(nodes: Sequence[Node], weights: Sequence[float]) -> Node:
    """The sum of weight * node, without those of weight 0."""
    pairs = [(weight, node) for weight, node in zip(weights, nodes, strict=True) if weight]
    terms = [node if weight == 1.0 else weight * node for weight, node in pairs]
    return reduce(operator.add, terms) if terms else cg.constant(0.0)


def numbered(register: str, count: int, first: int = 0) -> list[str]:
    """So many registers, by their numbers."""
    return [f"{register}{k}" for k in range(first, first + count)]


def advanced(target: str, weights: Weights, base: str = "x", slope: str = "slope") -> Map:
    """target = base + h * (sum of weight * slope)."""

    def ahead(x: Node, h: Node, *slopes: Node) -> Values:
        return {target: x + reduce(operator.add, _changes(h, slopes, weights))}

    return each(ahead, base, "h", *numbered(slope, len(weights)))


def summed(before: tuple[str, str], after: tuple[str, str], weights: Weights, slope: str = "slope") -> Map:
    """after = before + h * (sum of weight * slope): a state, and what rounding took off it so far (Kahan)."""

    def end(x: Node, rounding: Node, h: Node, *slopes: Node) -> Values:
        change, *rest = _changes(h, slopes, weights)
        return dict(zip(after, compensated(x, change + reduce(operator.add, rest, rounding)), strict=True))

    return each(end, *before, "h", *numbered(slope, len(weights)))


def _changes(h: Node, slopes: Sequence[Node], weights: Weights) -> list[Node]:
    """h * (sum of weight * slope), by the weights as float64 holds them, and by what it leaves of them, if anything."""
    first = [float(weight) for weight in weights]
    left = [float(weight - Fraction(number)) for weight, number in zip(weights, first, strict=True)]
    return [h * weighted(slopes, numbers) for numbers in (first, left) if numbers is first or any(left)]


def combined(rows: Sequence[Sequence[float]], sources: Sequence[str], targets: Sequence[str]) -> Map:
    """Statement for each target = sum of weight * source, by its row of weights."""
    return each(lambda *nodes: {to: weighted(nodes, row) for to, row in zip(targets, rows, strict=True)}, *sources)


def compensated(x: Node, more: Node) -> tuple[Node, Node]:
    """x + more, and what rounding takes off it, which the next sum may add (Kahan)."""
    result = x + more
    return result, more - (result - x)


def stage_time(target: str, c: float) -> Call:
    """target = t + c h."""
    return call(lambda t, h: {target: t + c * h})


def count(more: int, register: str = "evaluations") -> Call:
    """That many more in a register."""
    return call(lambda done: {register: done + float(more)}, register)
