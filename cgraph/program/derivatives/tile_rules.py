"""Derivatives of TiledMap and Scatter: those of the graph, tile by tile, and numbers where their values came from."""

from __future__ import annotations

from ...core.graph import Graph
from ...core.node import Node, constant
from ...writing.naming import variables
from ..statements.call import Sum, copied, copied_or_zero, zeroed
from ..statements.memory import Take
from ..statements.tiles import Scatter, TiledMap, element_sizes, tile_count
from .adjoint import Adjoint
from .call_rules import pushed_elements
from .memory_rules import collect_taken
from .products import Product, split
from .single_assignment import Assignment
from .tangent import Tangent

# What a TiledMap and a Scatter do not write stays as it was, and so does its tangent; its cotangent goes on to before.


def push_tiled_map(assignment: Assignment, tangent: Tangent) -> None:
    """y_dot = f'(x) x_dot in the tiles that are computed."""
    tiled: TiledMap = assignment.statement  # type: ignore[assignment]
    inputs, sizes = [element_sizes(tiled, tangent.lengths, names) for names in (tiled.inputs, tiled.outputs)]
    pushed = pushed_elements(tiled, inputs, sizes, tangent)
    before = [tangent.dots.get(name) for name in assignment.sources]
    moved = [k for k, old in enumerate(before) if k in pushed.kept or (tiled.tiles and old)]
    moved = [k for k in moved if tiled.outputs[k] in tangent.active]
    if not moved:
        return
    graph = pushed.graph or Graph([], {"none": 0.0})
    found = dict(zip(pushed.kept, split(list(graph.outputs.values()), [sizes[k] for k in pushed.kept]), strict=True))
    nodes = [node for k in moved for node in found.get(k, [constant(0.0)] * sizes[k])]
    results = tuple([tangent.dot(tiled.outputs[k]) for k in moved])
    for k, dot in zip(moved, results, strict=True):
        tangent.add(copied_or_zero(before[k], dot))
    tangent.add(TiledMap(_graph(graph.inputs, nodes), pushed.inputs, results, pushed.shared, tiled.lanes, tiled.tiles))


def pull_tiled_map(assignment: Assignment, adjoint: Adjoint) -> None:
    """x_bar += f'(x)^T y_bar in the tiles that are computed, summed over the elements for what they share."""
    tiled: TiledMap = assignment.statement  # type: ignore[assignment]
    inputs, first = (*tiled.shared, *tiled.inputs), len(tiled.shared)
    lengths = (*adjoint.of(tiled.shared), *element_sizes(tiled, adjoint.lengths, tiled.inputs))
    sizes = element_sizes(tiled, adjoint.lengths, tiled.outputs)
    seeded, wanted = adjoint.seeded(tiled.outputs), adjoint.wanted(inputs)
    if not seeded:
        return
    product = adjoint.products.pulled(tiled.graph, lengths, wanted, sizes, seeded) if wanted else Product(None, ())
    seeds = tuple([adjoint.bars[tiled.outputs[k]] for k in seeded])
    if product.graph is not None:
        count = tile_count(tiled, adjoint.lengths)
        terms = [
            adjoint.fresh("terms", lengths[k] * count * tiled.lanes) if k < first else adjoint.bar(inputs[k])
            for k in product.kept
        ]
        others = (*tiled.inputs, *(tiled.outputs if product.with_outputs else ()), *seeds)
        adjoint.add(*[zeroed(each) for each in terms])
        adjoint.add(TiledMap(product.graph, others, tuple(terms), tiled.shared, tiled.lanes, tiled.tiles))
        for k, term in zip(product.kept, terms, strict=True):
            adjoint.collect(inputs[k], term if k >= first else _summed(adjoint, inputs[k], term, count, tiled.lanes))
    for k, seed in zip(seeded, seeds, strict=True):
        if tiled.tiles and (old := assignment.sources[k]) in adjoint.active:
            bar = adjoint.bar(old)
            none = _graph([], [constant(0.0)] * sizes[k])
            adjoint.add(copied(seed, bar), TiledMap(none, (), (bar,), (), tiled.lanes, tiled.tiles))
            adjoint.collect(old, bar)


def _graph(inputs: tuple[Node, ...] | list[Node], outputs: list[Node]) -> Graph:
    return Graph(inputs, {f"{k}": node for k, node in enumerate(outputs)})


def _summed(adjoint: Adjoint, shared: str, terms: str, tiles: int, lanes: int) -> str:
    """A cotangent of what elements share: the sum of the terms of each."""
    size, bar, columns = adjoint.lengths[shared], adjoint.bar(shared), []
    for k in range(size):
        columns.append(adjoint.fresh("column", tiles * lanes))
        places = tuple([(tile * size + k) * lanes + lane for tile in range(tiles) for lane in range(lanes)])
        adjoint.add(Take(terms, columns[-1], places))
    nodes = variables([f"a{k}" for k in range(size)])
    adjoint.add(Sum(_graph(nodes, nodes), tuple(columns), (bar,)))
    return bar


def push_scatter(assignment: Assignment, tangent: Tangent) -> None:
    """target_dot[places[i]] = source_dot[table[i]]."""
    scatter: Scatter = assignment.statement  # type: ignore[assignment]
    (before,) = assignment.sources
    if scatter.target in tangent.active and {scatter.source, before} & tangent.dots.keys():
        dot = tangent.dot(scatter.target)
        tangent.add(copied_or_zero(tangent.dots.get(before), dot))
        tangent.add(Scatter(tangent.dot_or_zero(scatter.source), dot, scatter.table, scatter.places))


def pull_scatter(assignment: Assignment, adjoint: Adjoint) -> None:
    """source_bar[table[i]] += target_bar[places[i]], the last of those with one place; there target_bar before is 0."""
    scatter: Scatter = assignment.statement  # type: ignore[assignment]
    (before,) = assignment.sources
    if scatter.target not in adjoint.bars:
        return
    if before in adjoint.active:
        bar, none = adjoint.bar(before), adjoint.fresh("none", 1)
        adjoint.add(copied(adjoint.bars[scatter.target], bar), zeroed(none))
        adjoint.add(Scatter(none, bar, (0,) * len(scatter.places), scatter.places))
        adjoint.collect(before, bar)
    if scatter.source in adjoint.active:
        last = dict(zip(scatter.places, scatter.table, strict=True))
        collect_taken(adjoint, scatter.source, scatter.target, last.items())
