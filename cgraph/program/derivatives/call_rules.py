"""Derivatives of Call, Map, Sum: the jvp and the vjp of their graphs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...core.graph import Graph
from ..statement import Names
from ..statements.call import Call, Map, Sum, elements, sizes
from .adjoint import Adjoint
from .products import split
from .single_assignment import Assignment, Registers
from .tangent import Tangent

# tangents: y = f(x), y_dot = f'(x) x_dot


def push_elements(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot[i] = f'(x[i]) x_dot[i], or their sum; a call is one of them."""
    statement: Call | Map | Sum = assignment.statement  # type: ignore[assignment]
    common: Names = () if isinstance(statement, Call) else statement.shared
    names, first = (*common, *statement.inputs), len(common)
    moving, lengths = tangent.moving(names), _in_element(statement, tangent)
    if not moving or tangent.active.isdisjoint(statement.outputs):
        return
    product = tangent.products.pushed(statement.graph, lengths[0], moving, lengths[1])
    if product.graph is None:
        return
    dots, of_all = [tangent.dots[names[k]] for k in moving], sum([k < first for k in moving])
    others = (*statement.inputs, *dots[of_all:])
    results = tuple([tangent.dot(statement.outputs[k]) for k in product.kept])
    graph = _shared_first(product.graph, lengths[0], first, moving)
    if isinstance(statement, Call):
        tangent.add(Call(graph, others, results))
    else:
        tangent.add(replace(statement, graph=graph, inputs=others, outputs=results, shared=(*common, *dots[:of_all])))


def _in_element(statement: Call | Map | Sum, registers: Registers) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The numbers of the registers that are inputs of the graph for one element, and of those that are its outputs."""
    if isinstance(statement, Call):
        return registers.of(statement.inputs), registers.of(statement.outputs)
    inputs = (*registers.of(statement.shared), *sizes(statement, registers.lengths, statement.inputs))
    if isinstance(statement, Map):
        return inputs, sizes(statement, registers.lengths, statement.outputs)
    return inputs, registers.of(statement.outputs)


def _shared_first(graph: Graph, lengths: tuple[int, ...], first: int, moving: Sequence[int]) -> Graph:
    """The graph with the inputs that are shared first: numbers, their tangents, then those of elements."""
    groups = split(graph.inputs, [*lengths, *[lengths[k] for k in moving]])
    common = [k < first for k in (*range(len(lengths)), *moving)]
    order = [
        node
        for wanted in (True, False)
        for group, is_common in zip(groups, common, strict=True)
        for node in group
        if is_common is wanted
    ]
    return Graph(order, graph.outputs) if first else graph


# cotangents: x_bar += f'(x)^T y_bar


def pull_call(assignment: Assignment, adjoint: Adjoint) -> None:
    """x_bar += f'(x)^T y_bar."""
    call: Call = assignment.statement  # type: ignore[assignment]
    seeded, wanted = adjoint.seeded(call.outputs), adjoint.wanted(call.inputs)
    if not seeded or not wanted:
        return
    product = adjoint.products.pulled(call.graph, adjoint.of(call.inputs), wanted, adjoint.of(call.outputs), seeded)
    if product.graph is None:
        return
    bars = [adjoint.bar(call.inputs[k]) for k in product.kept]
    values = call.outputs if product.with_outputs else ()
    seeds = [adjoint.bars[call.outputs[k]] for k in seeded]
    adjoint.add(Call(product.graph, (*call.inputs, *values, *seeds), tuple(bars)))
    for k, bar in zip(product.kept, bars, strict=True):
        adjoint.collect(call.inputs[k], bar)


def pull_elements(assignment: Assignment, adjoint: Adjoint) -> None:
    """Cotangents of elements; their sum for a number that all elements share, or of length 1."""
    statement: Map | Sum = assignment.statement  # type: ignore[assignment]
    inputs, first = (*statement.shared, *statement.inputs), len(statement.shared)
    count, one_each = elements(statement, adjoint.lengths), isinstance(statement, Map)
    seeded, wanted = adjoint.seeded(statement.outputs), adjoint.wanted(inputs)
    if not seeded or not wanted or not count:
        return
    if isinstance(statement, Map) and statement.asked:
        raise TypeError("a Map of as many elements as are asked for has no cotangents")
    lengths, outputs = _in_element(statement, adjoint)
    product = adjoint.products.pulled(statement.graph, lengths, wanted, outputs, seeded, summed=not one_each)
    if product.graph is None:
        return
    seeds = tuple([adjoint.bars[statement.outputs[k]] for k in seeded])
    if product.with_outputs:
        seeds = (*statement.outputs, *seeds)
    wide = not one_each and any(length > 1 for length in outputs)  # of a Sum: the same for every element, end to end
    shared, others = (
        ((*statement.shared, *seeds), statement.inputs) if wide else (statement.shared, (*statement.inputs, *seeds))
    )
    nodes = product.graph.inputs
    if wide:
        known, size = sum(lengths[:first]), sum(lengths)
        nodes = (*nodes[:known], *nodes[size:], *nodes[known:size])
    results, at = list(product.graph.outputs.values()), 0
    for k in product.kept:
        name, length = inputs[k], lengths[k]
        graph = Graph(nodes, {f"bar{j}": node for j, node in enumerate(results[at : at + length])})
        at += length
        bar = adjoint.bar(name)
        in_all = k < first or adjoint.lengths[name] != count * length  # the same number for all elements
        adjoint.add(Sum(graph, others, (bar,), shared) if in_all else Map(graph, others, (bar,), shared))
        adjoint.collect(name, bar)
