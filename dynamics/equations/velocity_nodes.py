"""Rates: the nodes of a Lagrangian that are time derivatives of positions, which spare Lagrange's equation terms."""

from __future__ import annotations

from collections.abc import Sequence

from cgraph import Node
from cgraph.extend import UNLABELLED, Builder, topological


def rates(output: Node, q: Sequence[Node], qd: Sequence[Node], t: Node, build: Builder) -> list[Node]:
    """The rates z = d/dt f(q) in the graph of `output` that it is made from: those that anything else uses.

    For a rate, d/dt dz/dqd = dz/dq: both are (d2f/dq2) qd. So in Lagrange's equation for L(q, z(q, qd), t),
        d/dt dL/dqd - dL/dq = sum over z of (d/dt dL/dz) dz/dqd - dL/dq,   dL/dq at fixed z,
    and what the two sides of the left have in common is never built. The velocities qd are rates, so every L is such.

    Found are: qd_i; sums of rates; a rate times a constant; a rate of f(y) times g(y), for one node y of positions.
    build: made the nodes of `output`; a sum of rates is known for the rate of a node by the sum of their positions.
    """
    found = _Rates(q, qd, t, build)
    used: dict[Node, None] = {}
    for node in topological([output]):
        found.visit(node)
        if node not in found.position:
            used.update(dict.fromkeys([arg for arg in node.args if arg in found.position]))
    return [output] if output in found.position else list(used)


class _Rates:
    """What is known of the nodes visited so far."""

    def __init__(self, q: Sequence[Node], qd: Sequence[Node], t: Node, build: Builder) -> None:
        self.build = build
        self.moving = {*qd, t}  # depends on velocities or on time
        self.through = {x: x for x in q}  # of positions, and of rates of f(y): the one node y that it depends on q by
        self.through |= dict(zip(qd, q, strict=True))
        self.position: dict[Node, Node | None] = dict(zip(qd, q, strict=True))  # of rates: f, None where it is no node

    def visit(self, node: Node) -> None:
        """Learn about a node, its arguments having been visited."""
        if not any([arg in self.moving for arg in node.args]):
            self._place(node)
            return
        self.moving.add(node)
        if node.op.name in ("add", "sub", "neg"):
            if all([arg in self.position for arg in node.args]):
                self._sum(node)
        elif node.op.name == "mul":
            for factor, rate in (node.args, node.args[::-1]):
                if rate in self.position:
                    self._scaled(node, factor, rate)
        elif node.op.name == "div" and node.args[0] in self.position:
            self._scaled(node, node.args[1], node.args[0])

    def _place(self, node: Node) -> None:
        """A node of positions and constants: it depends on q through its arguments' one node, or is such a node."""
        by = {self.through[arg] for arg in node.args if arg in self.through}
        if by:
            self.through.setdefault(node, by.pop() if len(by) == 1 else node)

    def _sum(self, node: Node) -> None:
        places = [place for arg in node.args if (place := self.position[arg]) is not None]
        self.position[node] = None
        if len(places) == len(node.args):
            self._rate_of(node, self.build(node.op, tuple(places), UNLABELLED))

    def _scaled(self, node: Node, factor: Node, rate: Node) -> None:
        if factor in self.moving:
            return
        if factor not in self.through:
            self.position[node] = None
            if rate in self.through:
                self.through[node] = self.through[rate]
            if (place := self.position[rate]) is not None:
                args = tuple([place if arg is rate else arg for arg in node.args])
                self._rate_of(node, self.build(node.op, args, UNLABELLED))
        elif rate in self.through and self.through[factor] is self.through[rate]:
            self.position[node] = None
            self.through[node] = self.through[rate]

    def _rate_of(self, node: Node, place: Node) -> None:
        self._place(place)
        self.position[node] = place
        if place in self.through:
            self.through[node] = self.through[place]
