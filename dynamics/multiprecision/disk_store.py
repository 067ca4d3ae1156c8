"""A folder of reference solutions: a JSON file for a solution, named by all that the solution depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from cgraph import Graph
from cgraph.extend import atomic_write

from .solution import Reference, from_text

FORMAT = 1  # part of the name: count it up when the method changes so that old solutions are not what would be computed


def key(
    graph: Graph,
    states: Sequence[str],
    start: Sequence[float],
    times: Sequence[float],
    values: Mapping[str, float],
    method: str,
    digits: int,
) -> str:
    """The name of a solution: a hash of the equations by structure, numbers by their bits."""
    number = {node: i for i, node in enumerate(graph.nodes)}
    nodes = [
        (
            node.op.name,
            [number[arg] for arg in node.args],
            None if node.value is None else node.value.hex(),
            node.name if node.op.name == "variable" else None,
        )
        for node in graph.nodes
    ]
    rates = [number[node] for node in graph.outputs.values()]
    numbers = [[float(value).hex() for value in row] for row in (start, times, values.values())]
    content = [FORMAT, nodes, rates, list(states), list(values), numbers, method, digits]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


class Store:
    """Solutions in a folder, which is created on demand. Several programs may use it at once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, name: str, times: Sequence[float], width: int, solve: Callable[[], Reference]) -> Reference:
        """The solution of that name, at these times with so many states; computed and kept when it is not there."""
        path = self.folder / f"{name}.json"
        kept = _read(path, times, width)
        if kept is not None:
            return kept
        solution = solve()
        self.folder.mkdir(parents=True, exist_ok=True)
        atomic_write(path, json.dumps(_signed(solution)))  # a reader sees all of it or nothing
        return solution


def _signed(solution: Reference) -> dict[str, object]:
    content = {
        "t": [t.hex() for t in solution.t],
        "x": [list(row) for row in solution.decimal],
        "error": solution.error.hex(),
        "how": solution.how,
    }
    return content | {"sum": _sum(content)}


def _sum(content: Mapping[str, object]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _read(path: Path, times: Sequence[float], width: int) -> Reference | None:
    """The solution in a file, or None when there is none or it is not what was written."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content.pop("sum") != _sum(content):
            return None
        t = [float.fromhex(text) for text in content["t"]]
        if t != list(times) or {len(row) for row in content["x"]} != {width}:
            return None
        return from_text(t, content["x"], float.fromhex(content["error"]), content["how"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
