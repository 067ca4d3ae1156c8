"""TiledMap, Scatter: one graph in vectors of elements that lie in tiles, and numbers put among others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import GraphError
from ...core.graph import Graph
from ..statement import Execution, Lengths, Names, Statement, require_length

if TYPE_CHECKING:
    from ..writer import Writer


@dataclass(frozen=True)
class TiledMap(Statement):
    """outputs[e] = graph(shared, inputs[e]) for every element e, in tiles of so many lanes.

    Number k of the element e is at ((e // lanes) n + k) lanes + e % lanes, where an element has n numbers.
    tiles: a register that says how many are computed, at least one; others stay as they are.
    """

    graph: Graph
    inputs: str
    outputs: str
    shared: Names
    lanes: int
    tiles: str


@dataclass(frozen=True)
class Scatter(Statement):
    """target[places[i]] = source[table[i]]; other numbers of the target stay as they are."""

    source: str
    target: str
    table: tuple[int, ...]
    places: tuple[int, ...]


def check_tiled_map(statement: TiledMap, lengths: Lengths) -> None:
    """Raises GraphError if registers do not hold whole tiles, as many of them on either side."""
    where, graph = f"TiledMap of {statement.graph!r}", statement.graph
    tiles = lengths[statement.outputs] // (len(graph.outputs) * statement.lanes)
    size = len(graph.inputs) - sum([lengths[name] for name in statement.shared])
    require_length(lengths, where, statement.inputs, tiles * size * statement.lanes)
    require_length(lengths, where, statement.outputs, tiles * len(graph.outputs) * statement.lanes)
    require_length(lengths, where, statement.tiles, 1)


def run_tiled_map(statement: TiledMap, state: dict[str, Any], execution: Execution) -> None:
    """In Python, all elements as one batch, in place."""
    graph, tiles, lanes = statement.graph, int(state[statement.tiles][0]), statement.lanes
    shared = np.array([value for name in statement.shared for value in state[name]])
    known, size = len(shared), len(graph.inputs) - len(shared)
    points = np.empty((known + size, tiles, lanes))
    points[:known] = shared[:, None, None]
    rows = np.asarray(state[statement.inputs][: tiles * size * lanes])
    points[known:] = rows.reshape(tiles, size, lanes).transpose(1, 0, 2)
    results = execution.batch(graph, points.reshape(-1, tiles * lanes)).reshape(-1, tiles, lanes)
    state[statement.outputs][: results.size] = results.transpose(1, 0, 2).reshape(-1)


def tiled_map_text(statement: TiledMap, writer: Writer) -> None:
    """As machine code, a tile after another."""
    name = writer.functions.tiled_map(statement.graph, writer.lengths(statement.shared), statement.lanes)
    inputs = (*statement.shared, statement.inputs, statement.tiles)
    writer.calls(name, inputs, (statement.outputs,))


def check_scatter(statement: Scatter, lengths: Lengths) -> None:
    """Raises GraphError if a place is outside of its register."""
    for name, places in ((statement.source, statement.table), (statement.target, statement.places)):
        if places and not 0 <= min(places) <= max(places) < lengths[name]:
            raise GraphError(f"Scatter needs places from 0 to {lengths[name] - 1} of register {name!r}")


def run_scatter(statement: Scatter, state: dict[str, Any], _: Execution) -> None:
    """In Python, in place."""
    source, target = state[statement.source], state[statement.target]
    for number, place in zip(statement.table, statement.places, strict=True):
        target[place] = source[number]


def scatter_text(statement: Scatter, writer: Writer) -> None:
    """As machine code."""
    name = writer.functions.take(statement.table, statement.places)
    writer.line(f"call void @{name}({writer.arguments(statement.source, statement.target)})")
