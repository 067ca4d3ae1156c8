"""The edge: one use of a node by another."""

from __future__ import annotations

from typing import NamedTuple

from .node import Node, as_node


class Edge(NamedTuple):
    """One use of a node by another.

    Attributes
    ----------
    source, target : Node
        The argument, and the operation that uses it.
    slot : int
        Which argument of the target it is, from 0.
    partial : Node
        d target / d source through this slot alone.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.Edge(x, x * y, 0).partial
    <node variable y>
    """

    source: Node
    target: Node
    slot: int

    @property
    def partial(self) -> Node:
        """d target / d source through this slot alone, as a node."""
        return as_node(self.target.op.partials(self.target, *self.target.args)[self.slot])
