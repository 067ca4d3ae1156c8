"""A derivative graph in two: what the point alone decides, and what has to be done again for every direction."""

from __future__ import annotations

from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node, variable
from ..core.traversal import rebuild


class DirectionSplit(NamedTuple):
    """A derivative x, s -> y, linear in the direction s, as y = linear(primal(x), s).

    primal: x -> p, values that the other part reads.  linear: p, s -> y.
    """

    primal: Graph
    linear: Graph

    @property
    def directions(self) -> int:
        """The number of entries of a direction."""
        return len(self.linear.inputs) - len(self.primal.outputs)


def direction_split(derivative: Graph, directions: int) -> DirectionSplit:
    """The two parts of a derivative whose last `directions` inputs are the direction, as of `jvp` and `vjp`."""
    count = len(derivative.inputs) - directions
    points, seeds = derivative.inputs[:count], derivative.inputs[count:]
    directional = set(seeds)
    read: dict[Node, Node] = {}  # what the linear part reads of the primal one: the variable that stands for it
    for node in derivative.nodes:
        if not any([arg in directional for arg in node.args]):
            continue
        directional.add(node)
        for arg in node.args:
            if arg not in directional and arg.value is None and arg not in read:
                read[arg] = variable(f"p{len(read)}")
    for node in derivative.outputs.values():  # one that no direction changes
        if node not in directional and node.value is None and node not in read:
            read[node] = variable(f"p{len(read)}")
    stands = [*read.values()] or [variable("p0")]
    replace = read | {seed: variable(f"s{k}") for k, seed in enumerate(seeds)}
    new = rebuild(derivative.outputs.values(), replace, lambda node, args: Node(node.op, args, node.label))
    linear = Graph(
        [*stands, *(replace[seed] for seed in seeds)], {name: new[node] for name, node in derivative.outputs.items()}
    )
    return DirectionSplit(Graph(points, {str(each.name): node for node, each in read.items()} or {"p0": 0.0}), linear)
