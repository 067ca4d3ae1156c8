"""Statements as formulas: functions whose parameters are registers that they read, and whose results those they set."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any, TypeVar

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import STATEMENTS, Call, Factor, Map, Statement, Sum

Values = Mapping[str, Node | float | Sequence[Node | float]]
Rule = Callable[..., Values]
W = TypeVar("W", float, Fraction)


def call(rule: Rule, *reads: str, **lengths: int) -> Call:
    """Statement that sets registers by a rule of others.

    rule: a function of nodes, whose parameters are the registers that it reads (without an underscore at the end, where
    the name is one of Python's), and that gives {register: node} of those that it sets.  reads: these registers, where
    their names are others.  lengths: of those that are lists of several numbers; results may be such lists as well.

    >>> from dynamics.integrators import call
    >>> later = call(lambda t, h: {"t_new": t + h})
    >>> later.inputs, later.outputs
    (('t', 'h'), ('t_new',))
    """
    graph, inputs, outputs = _formula(rule, reads, lengths)
    return Call(graph, inputs, outputs)


def each(rule: Rule, *reads: str) -> Map:
    """Statement that sets registers by a rule of others, see `call`, component by component.

    >>> from dynamics.integrators import each
    >>> euler = each(lambda x, h, slope: {"x_new": x + h * slope})
    >>> euler.inputs, euler.outputs
    (('x', 'h', 'slope'), ('x_new',))
    """
    return Map(*_formula(rule, reads, {}))


def total(rule: Rule, *reads: str) -> Sum:
    """Statement that sets registers to the sums over all components of a rule of others, see `call`.

    >>> from dynamics.integrators import total
    >>> total(lambda x: {"square": x * x}).outputs
    ('square',)
    """
    return Sum(*_formula(rule, reads, {}))


def _formula(
    rule: Rule, reads: tuple[str, ...], lengths: Mapping[str, int]
) -> tuple[Graph, tuple[str, ...], tuple[str, ...]]:
    """The graph of a rule, and the registers that it reads and sets."""
    names = reads or tuple([name.rstrip("_") for name in inspect.signature(rule).parameters])
    values: list[Any] = [
        cg.variables([f"{name}[{k}]" for k in range(lengths[name])]) if name in lengths else cg.variable(name)
        for name in names
    ]
    results = rule(*values)
    outputs = enumerate(_end_to_end(results.values()))
    return Graph(_end_to_end(values), {f"{k}": number for k, number in outputs}), names, tuple(results)


def _end_to_end(values: Iterable[Any]) -> list[Any]:
    """Numbers, and those of lists."""
    return [number for value in values for number in (value if isinstance(value, list) else [value])]


def lengths_of(statements: Iterable[Statement], known: Mapping[str, int]) -> dict[str, int]:
    """Lengths of the registers that statements set, as far as these and those that are known tell.

    Component by component a result is as long as what it is made of, and a sum is one number. The numbers of a call are
    one for each register, or all of the only one that is not known. Pivots are as many as a matrix has rows.
    """
    every, lengths = list(_inside(statements)), dict(known)
    while True:
        before = dict(lengths)
        for statement in every:
            for name, length in _told(statement, known, lengths):
                if name not in known:
                    lengths[name] = max(length, lengths.get(name, 0))
        if lengths == before:
            return lengths


def _inside(statements: Iterable[Statement]) -> Iterator[Statement]:
    for statement in statements:
        yield statement
        for body in STATEMENTS[type(statement)].bodies:
            yield from _inside(getattr(statement, body))


def _told(statement: Statement, known: Mapping[str, int], lengths: Mapping[str, int]) -> Iterator[tuple[str, int]]:
    """Registers that a statement sets, with their lengths."""
    if isinstance(statement, Factor):
        yield statement.pivots, math.isqrt(lengths.get(statement.matrix, 0))
    if isinstance(statement, Call | Map | Sum):
        names, numbers, elements = statement.outputs, len(statement.graph.outputs), 1
        if isinstance(statement, Map):
            elements = max([lengths.get(name, 1) for name in statement.inputs], default=1)
        unknown = [name for name in names if name not in known]
        if len(names) == numbers:
            yield from [(name, elements) for name in names]
        elif len(unknown) == 1:
            yield unknown[0], elements * numbers - sum([known[name] for name in names if name in known])


def weighted(nodes: Sequence[Node], weights: Sequence[float]) -> Node:
    """The sum of weight * node, without those of weight 0."""
    result: Node | None = None
    for weight, node in zip(weights, nodes, strict=True):
        if weight:
            term = node if weight == 1.0 else weight * node
            result = term if result is None else result + term
    return cg.constant(0.0) if result is None else result


def used(weights: Sequence[W], register: str) -> tuple[list[str], list[W]]:
    """Registers, numbered from 0, whose weight is not 0; and these weights."""
    numbers = [k for k, weight in enumerate(weights) if weight]
    return [f"{register}{k}" for k in numbers], [weights[k] for k in numbers]


def advanced(target: str, weights: Sequence[float]) -> Map:
    """target = x + h * (sum of weight * slope)."""
    slopes, parts = used(weights, "slope")
    return each(lambda x, h, *slopes: {target: x + h * weighted(slopes, parts)}, "x", "h", *slopes)


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
