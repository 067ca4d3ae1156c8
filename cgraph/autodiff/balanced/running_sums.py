"""Long sums in blocks: a running sum of n terms, every partial sum of it in use or not, log n deep in place of n."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from ...core.builder import Builder
from ...core.graph import Graph
from ...core.node import Node
from ...core.scope import building
from ...core.traversal import topological
from ...util.require import require_graph

LEAST_TERMS = 16  # terms of a sum that is taken in blocks


class Block(NamedTuple):
    """A sum of 2^level terms next to one another, with its sign."""

    level: int
    node: Node
    negative: bool

    def plus(self, other: Block, level: int = 0) -> Block:
        """The sum of both."""
        if self.negative == other.negative:
            return Block(level, self.node + other.node, self.negative)
        first, second = (other, self) if self.negative else (self, other)
        return Block(level, first.node - second.node, negative=False)


def balanced_sums(graph: Graph) -> Graph:
    """The function with long running sums in blocks of 2, 4, 8 .. terms: their depth is the logarithm of n.

    A partial sum of k terms is made of the blocks that the binary digits of k stand for (as in Fenwick's tree). One sum
    of n terms takes n - 1 additions as before, and is log2 n + 1 deep at most; all of its partial sums take about
    n log2(n) / 2. Sums of less than 16 terms stay. Values can differ by rounding, which grows with log n in place of n.

    Parameters
    ----------
    graph : Graph
        Any graph.

    Returns
    -------
    Graph
        With the same inputs and outputs, simplified.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variables([f"x{i}" for i in range(64)])
    >>> total = sum(x[1:], x[0])
    >>> graph = cg.Graph(x, {"total": total})
    >>> graph.counts().depth, cg.balanced_sums(graph).counts().depth
    (63, 6)
    """
    require_graph("balanced_sums", graph)
    nodes = balanced(graph.outputs.values(), Builder())
    return Graph(graph.inputs, dict(zip(graph.outputs, nodes, strict=True)))


def balanced(nodes: Collection[Node], build: Builder) -> list[Node]:
    """The nodes, and all that they reach, folded, with long sums in blocks."""
    order = topological(nodes)
    running = _running(order)
    blocks: dict[Node, list[Block]] = {}
    new: dict[Node, Node] = {}
    with building(build) as labelled:
        for node in order:
            labelled(node.label)
            if node in running:
                blocks[node] = _with_term(node, running[node], blocks, new)
                new[node] = _total(blocks[node])
            else:
                args = tuple([new[arg] for arg in node.args])
                new[node] = build(node.op, args, node.label, node.name) if args else node
    return [new[node] for node in nodes]


def _running(order: Sequence[Node]) -> dict[Node, int]:
    """{sum: which of its arguments is the sum that it continues}, of sums of LEAST_TERMS terms or more."""
    before: dict[Node, int] = {}
    terms: dict[Node, int] = {}
    for node in order:
        if node.op.name in ("add", "sub"):
            k = max((0, 1), key=lambda k: terms.get(node.args[k], 1))
            before[node] = k
            terms[node] = terms.get(node.args[k], 1) + 1
    longest = dict(terms)
    for node in reversed(order):
        if node in before and (start := node.args[before[node]]) in longest:
            longest[start] = max(longest[start], longest[node])
    return {node: k for node, k in before.items() if longest[node] >= LEAST_TERMS}


def _with_term(node: Node, before: int, blocks: dict[Node, list[Block]], new: dict[Node, Node]) -> list[Block]:
    """The blocks of a sum: those of the sum that it continues and its last term, equal ones as one."""
    start, term = node.args[before], node.args[1 - before]
    signs = (False, node.op.name == "sub")
    result = blocks.get(start, [Block(0, new[start], negative=False)])
    if signs[before]:
        result = [block._replace(negative=not block.negative) for block in result]
    last = Block(0, new[term], signs[1 - before])
    while result and result[-1].level == last.level:
        last = result[-1].plus(last, last.level + 1)
        result = result[:-1]
    return [*result, last]


def _total(blocks: Sequence[Block]) -> Node:
    """The sum of blocks, the smallest first."""
    total = blocks[-1]
    for block in reversed(blocks[:-1]):
        total = block.plus(total)
    return -total.node if total.negative else total.node
