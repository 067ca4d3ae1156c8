"""Derivatives of Call, Map, Sum: the jvp and the vjp of their graphs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from ...core.graph import Graph
from ..statements.call import Call, Map, Sum, elements
from .adjoint import Adjoint
from .products import Product
from .single_assignment import Assignment
from .tangent import Tangent

# tangents: y = f(x), y_dot = f'(x) x_dot


def push_call(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot = f'(x) x_dot."""
    call: Call = assignment.statement  # type: ignore[assignment]
    moving = tangent.moving(call.inputs)
    if not moving or tangent.active.isdisjoint(call.outputs):
        return
    product = tangent.products.pushed(call.graph, tangent.of(call.inputs), moving, tangent.of(call.outputs))
    if product.graph is not None:
        dots = [tangent.dots[call.inputs[k]] for k in moving]
        results = tuple([tangent.dot(call.outputs[k]) for k in product.kept])
        tangent.add(Call(product.graph, (*call.inputs, *dots), results))


def push_elements(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot[i] = f'(x[i]) x_dot[i], or their sum."""
    statement: Map | Sum = assignment.statement  # type: ignore[assignment]
    inputs, first = (*statement.shared, *statement.inputs), len(statement.shared)
    moving = tangent.moving(inputs)
    if not moving or tangent.active.isdisjoint(statement.outputs):
        return
    lengths = (*tangent.of(statement.shared), *[1] * len(statement.inputs))
    one_each = isinstance(statement, Map)
    outputs = (1,) * len(statement.outputs) if one_each else tangent.of(statement.outputs)
    product = tangent.products.pushed(statement.graph, lengths, moving, outputs)
    if product.graph is None:
        return
    shared = (*statement.shared, *[tangent.dots[inputs[k]] for k in moving if k < first])
    others = (*statement.inputs, *[tangent.dots[inputs[k]] for k in moving if k >= first])
    graph = shared_first(product, lengths, first, moving)
    results = tuple([tangent.dot(statement.outputs[k]) for k in product.kept])
    tangent.add(type(statement)(graph, others, results, shared))


def shared_first(product: Product, lengths: tuple[int, ...], first: int, moving: Sequence[int]) -> Graph:
    """The graph with the inputs that are shared first: numbers, their tangents, then those of elements."""
    graph = product.graph
    assert graph is not None
    if not first:
        return graph
    sizes = [*lengths, *[lengths[k] for k in moving]]
    common = [k < first for k in (*range(len(lengths)), *moving)]
    ends = list(itertools.accumulate(sizes, initial=0))
    groups = [graph.inputs[start:end] for start, end in itertools.pairwise(ends)]
    order = [
        node
        for wanted in (True, False)
        for group, is_common in zip(groups, common, strict=True)
        for node in group
        if is_common is wanted
    ]
    return Graph(order, graph.outputs)


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
    """Of a number that all elements share, or of length 1, the sum over the elements."""
    statement: Map | Sum = assignment.statement  # type: ignore[assignment]
    inputs, first = (*statement.shared, *statement.inputs), len(statement.shared)
    count, one_each = elements(statement, adjoint.lengths), isinstance(statement, Map)
    seeded, wanted = adjoint.seeded(statement.outputs), adjoint.wanted(inputs)
    if not seeded or not wanted or not count:
        return
    lengths = (*adjoint.of(statement.shared), *[1] * len(statement.inputs))
    outputs = (1,) * len(statement.outputs) if one_each else adjoint.of(statement.outputs)
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
        in_all = k < first or adjoint.lengths[name] != count  # the same number for all elements
        adjoint.add(Sum(graph, others, (bar,), shared) if in_all else Map(graph, others, (bar,), shared))
        adjoint.collect(name, bar)
