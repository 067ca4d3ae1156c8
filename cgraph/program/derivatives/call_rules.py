"""Derivatives of Call, Map, Sum: the jvp and the vjp of their graphs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...core.graph import Graph
from ..statement import Names
from ..statements.call import Call, Map, Sum, elements, sizes
from .jvp import Assignment, Tangent, split, tangent_graph
from .transpose import Adjoint, cotangent_graph

Numbers = tuple[int, ...]


def _parts(assignment: Assignment, lengths: Mapping[str, int]) -> tuple[Call | Map | Sum, Names, Numbers, Numbers]:
    """The statement, the shared registers, and how many numbers each input and output has of an element."""
    statement: Call | Map | Sum = assignment.statement  # type: ignore[assignment]
    inputs, outputs = (tuple([lengths[name] for name in names]) for names in (statement.inputs, statement.outputs))
    if isinstance(statement, Call):
        return statement, (), inputs, outputs
    inputs = (*[lengths[name] for name in statement.shared], *sizes(statement, lengths, statement.inputs))
    if isinstance(statement, Map):
        outputs = sizes(statement, lengths, statement.outputs)
    return statement, statement.shared, inputs, outputs


def push_elements(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot[i] = f'(x[i]) x_dot[i], or their sum; a call is one of them."""
    statement, shared, lengths, outputs = _parts(assignment, tangent.lengths)
    names, first = (*shared, *statement.inputs), len(shared)
    moving = tuple([k for k, name in enumerate(names) if name in tangent.dots and tangent.lengths[name]])
    if not moving or tangent.active.isdisjoint(statement.outputs):
        return
    graph, kept = tangent_graph(statement.graph, lengths, moving, outputs)
    if graph is None:
        return
    dots, of_all = tuple([tangent.dots[names[k]] for k in moving]), sum([k < first for k in moving])
    inputs, results = (*statement.inputs, *dots[of_all:]), tuple([tangent.dot(statement.outputs[k]) for k in kept])
    if isinstance(statement, Call):
        tangent.add(Call(graph, inputs, results))
        return
    if first:  # what is shared comes first: numbers, their tangents, then those of elements
        groups = split(graph.inputs, [*lengths, *[lengths[k] for k in moving]])
        order = sorted(zip([k >= first for k in (*range(len(lengths)), *moving)], groups, strict=True), key=_is_first)
        graph = Graph([node for _, group in order for node in group], graph.outputs)
    tangent.add(replace(statement, graph=graph, inputs=inputs, outputs=results, shared=(*shared, *dots[:of_all])))


def _is_first(group: tuple[bool, Sequence[object]]) -> bool:
    return group[0]


def pull_elements(assignment: Assignment, adjoint: Adjoint) -> None:
    """x_bar[i] += f'(x[i])^T y_bar[i]; their sum for a number that all elements share, or of length 1."""
    statement, shared, lengths, outputs = _parts(assignment, adjoint.lengths)
    names, first = (*shared, *statement.inputs), len(shared)
    count = 1 if isinstance(statement, Call) else elements(statement, adjoint.lengths)
    seeded = tuple([k for k, name in enumerate(statement.outputs) if name in adjoint.bars])
    wanted = tuple([k for k, name in enumerate(names) if name in adjoint.active and adjoint.lengths[name]])
    if not seeded or not wanted or not count:
        return
    if isinstance(statement, Map) and statement.asked:
        raise TypeError("a Map of as many elements as are asked for has no cotangents")
    total, rule = adjoint.rules.get(id(statement.graph), (0, None))
    if not isinstance(statement, Call) or total != sum([outputs[k] for k in seeded]):
        rule = None
    graph, kept = cotangent_graph(statement.graph, rule, lengths, wanted, outputs, seeded)
    if graph is None:
        return
    seeds = tuple([adjoint.bars[statement.outputs[k]] for k in seeded])
    if isinstance(statement, Call):
        bars = tuple([adjoint.bar(names[k]) for k in kept])
        adjoint.add(Call(graph, (*names, *(statement.outputs if rule else ()), *seeds), bars))
        for k, bar in zip(kept, bars, strict=True):
            adjoint.collect(names[k], bar)
        return
    nodes, inputs = graph.inputs, (*statement.inputs, *seeds)
    if isinstance(statement, Sum) and any(length > 1 for length in outputs):  # seeds the same for every element
        known, size = sum(lengths[:first]), sum(lengths)
        nodes = (*nodes[:known], *nodes[size:], *nodes[known:size])
        shared, inputs = (*shared, *seeds), statement.inputs
    results, at = list(graph.outputs.values()), 0
    for k in kept:
        one = Graph(nodes, {f"bar{j}": node for j, node in enumerate(results[at : at + lengths[k]])})
        at += lengths[k]
        bar = adjoint.bar(names[k])
        in_all = k < first or adjoint.lengths[names[k]] != count * lengths[k]  # the same number for all elements
        adjoint.add(Sum(one, inputs, (bar,), shared) if in_all else Map(one, inputs, (bar,), shared))
        adjoint.collect(names[k], bar)
