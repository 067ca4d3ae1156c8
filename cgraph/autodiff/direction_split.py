"""A derivative graph in two: what the point alone decides, and what has to be done again for every direction."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..core.graph import Graph
from ..core.node import Node, as_node, variable
from ..core.traversal import rebuild
from ..operations.operation import OPS


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


def direction_split(derivative: Graph, directions: int, *, divide: bool = True) -> DirectionSplit:
    """The two parts of a derivative whose last `directions` inputs are the direction, as of `jvp` and `vjp`.

    divide: whether the linear part may divide, and hold infinite constants. If not, it reads reciprocals and such
    constants from the primal part: then what it reads is infinite or NaN wherever a slope is.
    """
    count = len(derivative.inputs) - directions
    points, seeds = derivative.inputs[:count], derivative.inputs[count:]
    directional = set(seeds)
    reciprocals: dict[Node, Node] = {}  # of divisors
    factors: dict[Node, Node] = {}  # of a quotient: the reciprocal of its divisor
    read: dict[Node, Node] = {}  # what the linear part reads of the primal one: the variable that stands for it
    for node in derivative.nodes:
        if not any([arg in directional for arg in node.args]):
            continue
        directional.add(node)
        args = node.args
        if not divide and node.op is OPS["div"]:
            factors[node] = reciprocals.setdefault(args[1], Node(node.op, (as_node(1.0), args[1])))
            args = (args[0], factors[node])
        for arg in args:
            fixed = arg.value is not None and (divide or math.isfinite(arg.value))
            if arg not in directional and not fixed and arg not in read:
                read[arg] = variable(f"p{len(read)}")
    for node in derivative.outputs.values():  # one that no direction changes
        if node not in directional and node.value is None and node not in read:
            read[node] = variable(f"p{len(read)}")
    stands = [*read.values()] or [variable("p0")]
    replace = read | {seed: variable(f"s{k}") for k, seed in enumerate(seeds)}

    def copied(node: Node, args: tuple[Node, ...]) -> Node:
        if node in factors:
            return Node(OPS["mul"], (read[factors[node]], args[0]), node.label)
        return Node(node.op, args, node.label)

    new = rebuild(derivative.outputs.values(), replace, copied)
    linear = Graph(
        [*stands, *(replace[seed] for seed in seeds)], {name: new[node] for name, node in derivative.outputs.items()}
    )
    return DirectionSplit(Graph(points, {str(each.name): node for node, each in read.items()} or {"p0": 0.0}), linear)
