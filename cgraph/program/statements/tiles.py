"""TiledMap, Scatter: one graph in vectors of elements that lie in tiles, and numbers put among others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import GraphError
from ...core.evaluation import Array
from ...core.graph import Graph
from ..statement import Execution, Lengths, Names, Statement, length_of, require_length, require_once

if TYPE_CHECKING:
    from ..writer import Writer


@dataclass(frozen=True)
class TiledMap(Statement):
    """outputs[e] = graph(shared, inputs[e]) for every element e, in tiles of so many lanes.

    Number k of an element's n in a register is at ((e // lanes) n + k) lanes + e % lanes.
    inputs, outputs: registers which, end to end, hold the numbers of an element.
    tiles: a register that says how many are computed, at least one; others stay as they are. Without it all are.
    """

    graph: Graph
    inputs: Names
    outputs: Names
    shared: Names
    lanes: int
    tiles: Names = ()


@dataclass(frozen=True)
class Scatter(Statement):
    """target[places[i]] = source[table[i]]; other numbers of the target stay as they are."""

    source: str
    target: str
    table: tuple[int, ...]
    places: tuple[int, ...]


def tile_count(statement: TiledMap, lengths: Lengths) -> int:
    """The number of tiles that the registers hold."""
    return sum([lengths[name] for name in statement.outputs]) // max(1, len(statement.graph.outputs) * statement.lanes)


def element_sizes(statement: TiledMap, lengths: Lengths, names: Names) -> tuple[int, ...]:
    """The numbers that an element has in each of some registers."""
    count = max(1, tile_count(statement, lengths) * statement.lanes)
    return tuple([lengths[name] // count for name in names])


def check_tiled_map(statement: TiledMap, lengths: Lengths) -> None:
    """Raises GraphError if registers do not hold whole tiles, as many of them on either side."""
    where, graph = f"TiledMap of {statement.graph!r}", statement.graph
    for name in (*statement.shared, *statement.inputs, *statement.outputs):
        length_of(lengths, where, name)
    count = tile_count(statement, lengths) * statement.lanes
    known = sum([lengths[name] for name in statement.shared])
    if known > len(graph.inputs):
        raise GraphError(f"{where} has {len(graph.inputs)} inputs, the shared registers hold {known}")
    for names, wanted in ((statement.inputs, len(graph.inputs) - known), (statement.outputs, len(graph.outputs))):
        sizes = element_sizes(statement, lengths, names)
        for name, size in zip(names, sizes, strict=True):
            require_length(lengths, where, name, count * size)
        if sum(sizes) != wanted:
            raise GraphError(f"{where} needs {wanted} numbers of an element, {', '.join(names)} hold {sum(sizes)}")
    for name in statement.tiles:
        require_length(lengths, where, name, 1)
    require_once(where, statement.outputs)
    if both := {*statement.outputs} & {*statement.inputs, *statement.shared, *statement.tiles}:
        raise GraphError(f"{where} both reads and writes register {min(both)!r}")


def run_tiled_map(statement: TiledMap, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python, all elements as one batch; of one memory or of many."""
    lengths, tail = execution.lengths, () if execution.many < 0 else (execution.many,)
    tiles = np.full(tail, float(tile_count(statement, lengths)))
    for name in statement.tiles:
        number = np.asarray(state[name])[0]
        tiles = np.minimum(np.where(number > 1.0, np.floor(number), 1.0), tiles)
    most = int(tiles.max(initial=0.0))
    shape = (most, statement.lanes, *tail)

    def numbers(name: str, size: int) -> Array:
        """Numbers of the elements, (most, size, lanes, ..)."""
        return np.asarray(state[name])[: most * size * statement.lanes].reshape(most, size, *shape[1:])

    rows = [np.broadcast_to(value, shape) for name in statement.shared for value in state[name]]
    for name, size in zip(statement.inputs, element_sizes(statement, lengths, statement.inputs), strict=True):
        rows += [*numbers(name, size).swapaxes(0, 1)]
    points = np.array(rows).reshape(len(rows), int(np.prod(shape)))
    results, at = execution.batch(statement.graph, points).reshape(len(statement.graph.outputs), *shape), 0
    computed = np.arange(most).reshape(-1, 1, 1, *[1 for _ in tail]) < tiles
    for name, size in zip(statement.outputs, element_sizes(statement, lengths, statement.outputs), strict=True):
        found = np.where(computed, results[at : at + size].swapaxes(0, 1), numbers(name, size))
        found = found.reshape(most * size * statement.lanes, *tail)
        if tail:  # else in place
            state[name] = np.array(state[name])
        state[name][: len(found)] = found if isinstance(state[name], np.ndarray) else found.tolist()
        at += size


def tiled_map_text(statement: TiledMap, writer: Writer) -> None:
    """Write as machine code, a tile after another; where memories lie side by side, an element after another."""
    inputs, outputs = (element_sizes(statement, writer.registers, of) for of in (statement.inputs, statement.outputs))
    shared, count = writer.lengths(statement.shared), tile_count(statement, writer.registers)
    if count:
        how = statement.lanes, count, bool(statement.tiles)
        name = writer.functions.tiled_map(statement.graph, shared, inputs, outputs, *how)
        writer.calls(name, (*statement.shared, *statement.inputs, *statement.tiles), statement.outputs)


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


def run_scatter(statement: Scatter, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python."""
    if execution.many >= 0:  # else in place
        state[statement.target] = np.array(state[statement.target])
    source, target = state[statement.source], state[statement.target]
    for number, place in zip(statement.table, statement.places, strict=True):
        target[place] = source[number] if execution.many >= 0 else float(source[number])


def scatter_text(statement: Scatter, writer: Writer) -> None:
    """Write as machine code."""
    name = writer.functions.take(statement.table, statement.places)
    writer.line(f"call void @{name}({writer.arguments(statement.source, statement.target)})")
