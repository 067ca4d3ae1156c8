"""Builder: how derived nodes are made, folded by the rules of the operations' rows, and shared."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from .label import Label
from .node import CONSTANT, Node, constant
from .row import Row
from .scope import building
from .traversal import rebuild


class Builder:
    """Builds nodes folded and shared: the same operation on the same arguments is made once.

    Merging unites labels, and keeps the first name. Only nodes that this builder made are merged, so that no other
    node changes. A node without tags, such as the sum of cotangents at a variable, takes those of its arguments.

    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, building
    >>> x = cg.variable("x")
    >>> with building(Builder()):
    ...     print(0.0 + x is x, x * cg.sin(x) is x * cg.sin(x))
    True True
    """

    def __init__(self) -> None:
        self._made: dict[tuple[str | int, ...], Node] = {}

    def __call__(self, op: Row, args: tuple[Node, ...], label: Label, name: str | None = None) -> Node:
        """The node of this operation on these arguments; a name is kept by a node made here for the first time."""
        for arg in args:
            if arg.op is not CONSTANT:  # rules are for arguments that are not all constants; the rest is below
                if op.fold is not None and (node := op.fold(*args)) is not None:
                    return node  # type: ignore[no-any-return]
                break
        else:  # no break: all are constants
            value = op.scalar(*[arg.value for arg in args])
            if value == value:  # no constant is NaN: the operation then stays
                return constant(value)
        # A difference made here is turned round; one that was there before has other uses, and its sign stays apart.
        if op.name == "neg" and args[0].op.name == "sub":
            a, b = args[0].args
            if self._made.get(("sub", id(a), id(b))) is args[0]:
                return self(args[0].op, (b, a), label, name)
        # a * b and b * a are one node, with a constant first, else in the order of the one that was made first.
        if op.commutative and args[1].op is CONSTANT and args[0].op is not CONSTANT:
            args = args[::-1]
        # By ids: the garbage collector would follow nodes. The node made keeps its arguments alive.
        key: tuple[str | int, ...] = (op.name, *map(id, args))
        if op.commutative and id(args[0]) > id(args[1]):
            key = (op.name, key[2], key[1])
        node = self._made.get(key)
        if node is None:
            if not label.has_tags:
                for arg in args:
                    label = label.with_tags_of(arg.label)
            node = self._made[key] = Node(op, args, label, name=name)
            return node
        if node.label is not label:
            object.__setattr__(node, "label", node.label.union(label))
        if node.name is None and name is not None:
            object.__setattr__(node, "name", name)
        return node


def folded(nodes: Collection[Node], build: Builder, replace: Mapping[Node, Node] | None = None) -> list[Node]:
    """Copies of nodes, and of all that they reach, made by a builder; replace: {node: what stands in its place}.

    One pass is enough: the rules see arguments that are folded already, so a second pass would change nothing.

    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, folded
    >>> x = cg.variable("x")
    >>> folded([1.0 * x + 0.0], Builder())
    [<node variable x>]
    """
    with building(build) as labelled:

        def make(node: Node, args: tuple[Node, ...]) -> Node:
            labelled(node.label)
            return build(node.op, args, node.label, node.name)

        new = rebuild(nodes, dict(replace or {}), make)
    return [new[node] for node in nodes]
