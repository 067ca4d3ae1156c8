"""TiledMap, Scatter: one graph in vectors of elements that lie in tiles, and numbers put among others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import GraphError
from ...core.graph import Graph
from ..statement import Lengths, Names, Statement, require_length

if TYPE_CHECKING:
    from ..execution import Execution
    from ..writer import Writer


@dataclass(frozen=True)
class TiledMap(Statement):
    """outputs[e] = graph(shared, inputs[e]) for every element e, in tiles of so many lanes.

    Number k of the element e is at ((e // lanes) n + k) lanes + e % lanes, where an element has n numbers.
    """

    graph: Graph
    inputs: str
    outputs: str
    shared: Names
    lanes: int


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
    known, tiles = _sizes(statement, lengths)
    require_length(lengths, where, statement.inputs, tiles * (len(graph.inputs) - known) * statement.lanes)
    require_length(lengths, where, statement.outputs, tiles * len(graph.outputs) * statement.lanes)


def _sizes(statement: TiledMap, lengths: Lengths) -> tuple[int, int]:
    """How many numbers are shared, and how many tiles there are."""
    known = sum([lengths[name] for name in statement.shared])
    return known, lengths[statement.outputs] // (max(1, len(statement.graph.outputs)) * statement.lanes)


def run_tiled_map(statement: TiledMap, state: dict[str, Any], execution: Execution) -> None:
    """In Python, all elements as one batch."""
    (known, tiles), lanes = _sizes(statement, execution.lengths), statement.lanes
    shared = [value for name in statement.shared for value in state[name]]
    rows = np.array(state[statement.inputs]).reshape(tiles, -1, lanes).transpose(1, 0, 2).reshape(-1, tiles * lanes)
    points = np.concatenate([np.repeat(np.reshape(shared, (known, 1)), tiles * lanes, axis=1), rows])
    results = execution.batch(statement.graph, points).reshape(-1, tiles, lanes)
    state[statement.outputs] = results.transpose(1, 0, 2).ravel().tolist()


def tiled_map_text(statement: TiledMap, writer: Writer) -> None:
    """As machine code, a tile after another."""
    _, tiles = _sizes(statement, writer.registers)
    name = writer.functions.tiled_map(statement.graph, writer.lengths(statement.shared), tiles, statement.lanes)
    writer.calls(name, (*statement.shared, statement.inputs), (statement.outputs,))


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
