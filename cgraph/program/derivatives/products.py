"""Products: graphs of J^T y_bar and J x_dot of the graphs that statements call, derived once."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, TypeVar

from ...autodiff.products import jvp, vjp
from ...core.graph import Graph
from ...core.node import Node
from ...simplification.simplify import simplify

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


class Pullback(Protocol):
    """A rule of a graph's own for J^T y_bar, which may read the values of its outputs."""

    @property
    def residuals(self) -> int:
        """Number of the last outputs that have no cotangents."""
        ...

    def __call__(self, wrt: Sequence[Node]) -> Graph:
        """Graph from inputs, values of outputs and their cotangents to the cotangents of `wrt`."""
        ...


class Products:
    """Products of any graph; a zero that is one whatever the numbers are is left out.

    pullbacks: {id of a graph: its own rule}.
    """

    def __init__(self, pullbacks: Mapping[int, Pullback]) -> None:
        self._pullbacks = pullbacks
        self._made: dict[tuple[object, ...], Product] = {}
        self._graphs: list[Graph] = []  # whose ids are keys

    def pulled(
        self, graph: Graph, inputs: Lengths, wanted: Chosen, outputs: Lengths, seeded: Chosen, *, summed: bool = False
    ) -> Product:
        """Cotangents of the inputs `wanted` from those of the outputs `seeded`.

        Inputs of the graph: its own, the values of its outputs where a rule reads them, cotangents.
        summed: the values of the outputs are not there, but their sums.
        """
        key = ("pull", id(graph), inputs, wanted, outputs, seeded, summed)
        if key not in self._made:
            self._graphs.append(graph)
            pullback = None if summed else self._pullbacks.get(id(graph))
            self._made[key] = _pulled(graph, pullback, inputs, wanted, outputs, seeded)
        return self._made[key]

    def pushed(self, graph: Graph, inputs: Lengths, moving: Chosen, outputs: Lengths) -> Product:
        """Tangents of outputs from those of the inputs `moving`. Inputs of the graph: its own, tangents."""
        key = ("push", id(graph), inputs, moving, outputs)
        if key not in self._made:
            self._graphs.append(graph)
            groups = split(graph.inputs, inputs)
            pushed = simplify(jvp(graph, [node for k in moving for node in groups[k]]))
            results = split(list(pushed.outputs.values()), outputs)
            self._made[key] = _product(pushed.inputs, dict(enumerate(results)), with_outputs=False)
        return self._made[key]


def _pulled(
    graph: Graph, pullback: Pullback | None, inputs: Lengths, wanted: Chosen, outputs: Lengths, seeded: Chosen
) -> Product:
    groups = [group for k, group in enumerate(split(graph.inputs, inputs)) if k in wanted]
    by = [node for group in groups for node in group]
    known = pullback is not None and len(seeded) == len(outputs) - bool(pullback.residuals)
    if pullback is not None and known:
        pulled = pullback(by)
    else:
        names = [name for k, part in enumerate(split(list(graph.outputs), outputs)) if k in seeded for name in part]
        pulled = simplify(vjp(Graph(graph.inputs, {name: graph.outputs[name] for name in names}), by))
    results = split(list(pulled.outputs.values()), tuple([len(group) for group in groups]))
    return _product(pulled.inputs, dict(zip(wanted, results, strict=True)), known)


def _product(inputs: Sequence[Node], results: Mapping[int, Sequence[Node]], with_outputs: bool) -> Product:
    kept = {k: nodes for k, nodes in results.items() if any(node.value != 0.0 for node in nodes)}
    nodes = [node for group in kept.values() for node in group]
    graph = Graph(inputs, {f"{k}": node for k, node in enumerate(nodes)}) if nodes else None
    return Product(graph, tuple(kept), with_outputs)


def split(items: Sequence[T], lengths: Sequence[int]) -> list[Sequence[T]]:
    """The items, end to end, by the registers that hold them."""
    ends = list(itertools.accumulate(lengths, initial=0))
    return [items[start:end] for start, end in itertools.pairwise(ends)]
