"""Products: graphs of J^T y_bar and J x_dot of the graphs that statements call, each derived once."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import cgraph as cg
from cgraph import Graph, Node

from .rate_pullback import RatePullback

T = TypeVar("T")
Lengths = tuple[int, ...]  # of the registers that are the inputs of a graph, or its outputs
Chosen = tuple[int, ...]  # some of them


class Product(NamedTuple):
    """A graph, the registers that are its outputs, and whether its inputs have the values of the outputs in them.

    Where nothing depends on what moves there is no graph.
    """

    graph: Graph | None
    kept: Chosen
    with_outputs: bool = False


class Products:
    """Of any graph; a zero that is one whatever the numbers are is left out.

    pullbacks: {id of a graph: what gives its J^T y_bar in a shorter way}, which may read the outputs' values.
    """

    def __init__(self, pullbacks: Mapping[int, RatePullback]) -> None:
        self._pullbacks = pullbacks
        self._made: dict[tuple[object, ...], Product] = {}
        self._graphs: list[Graph] = []  # whose ids are keys

    def pulled(self, graph: Graph, inputs: Lengths, wanted: Chosen, outputs: Lengths, seeded: Chosen) -> Product:
        """Cotangents of the inputs `wanted` from those of the outputs `seeded`.

        Inputs of the graph: its own, the values of its outputs where a pullback reads them, cotangents.
        """
        key = ("pull", id(graph), inputs, wanted, outputs, seeded)
        if key not in self._made:
            self._graphs.append(graph)
            self._made[key] = self._pull(graph, inputs, wanted, outputs, seeded)
        return self._made[key]

    def _pull(self, graph: Graph, inputs: Lengths, wanted: Chosen, outputs: Lengths, seeded: Chosen) -> Product:
        groups = [group for k, group in enumerate(_split(graph.inputs, inputs)) if k in wanted]
        by = [node for group in groups for node in group]
        pullback = self._pullbacks.get(id(graph))
        known = pullback is not None and len(seeded) == len(outputs) - bool(pullback.shared)
        if pullback is not None and known:
            pulled = pullback(by)
        else:
            names = [
                name for k, part in enumerate(_split(list(graph.outputs), outputs)) if k in seeded for name in part
            ]
            pulled = cg.simplify(cg.vjp(Graph(graph.inputs, {name: graph.outputs[name] for name in names}), by))
        results = _split(list(pulled.outputs.values()), tuple([len(group) for group in groups]))
        return _product(pulled.inputs, dict(zip(wanted, results, strict=True)), known)

    def pushed(self, graph: Graph, inputs: Lengths, moving: Chosen, outputs: Lengths) -> Product:
        """Tangents of outputs from those of the inputs `moving`. Inputs of the graph: its own, tangents."""
        key = ("push", id(graph), inputs, moving, outputs)
        if key not in self._made:
            self._graphs.append(graph)
            groups = _split(graph.inputs, inputs)
            pushed = cg.simplify(cg.jvp(graph, [node for k in moving for node in groups[k]]))
            results = _split(list(pushed.outputs.values()), outputs)
            self._made[key] = _product(pushed.inputs, dict(enumerate(results)), with_outputs=False)
        return self._made[key]


def _product(inputs: Sequence[Node], results: Mapping[int, Sequence[Node]], with_outputs: bool) -> Product:
    kept = {k: nodes for k, nodes in results.items() if any(node.value != 0.0 for node in nodes)}
    nodes = [node for group in kept.values() for node in group]
    graph = Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)}) if nodes else None
    return Product(graph, tuple(kept), with_outputs)


def _split(items: Sequence[T], lengths: Lengths) -> list[Sequence[T]]:
    """The items, end to end, by the registers that hold them."""
    ends = list(itertools.accumulate(lengths, initial=0))
    return [items[start:end] for start, end in itertools.pairwise(ends)]
