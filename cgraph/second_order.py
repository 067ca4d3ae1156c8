"""Second partial derivatives of the operations, derived once from their rows and put in place of need."""

from __future__ import annotations

from functools import cache

from .fold import Builder
from .forward import tangents
from .label import building
from .node import Node, Op, as_node, variable
from .order import rebuild


def second_partial(node: Node, j: int, k: int, build: Builder) -> Node:
    """d2 node / d args[j] d args[k], the arguments taken as independent, as a node made by `build`."""
    output, arguments, partials = _partials_of(node.op)
    replace = {output: node} | dict(zip(arguments, node.args, strict=True))
    root = partials[min(j, k), max(j, k)]
    return rebuild([root], replace, lambda n, args: build(n.op, args, node.label))[root]


@cache
def _partials_of(op: Op) -> tuple[Node, list[Node], dict[tuple[int, int], Node]]:
    """Placeholders for the output and the arguments of an operation, and its second partials over them."""
    output = variable("output#")
    arguments = [variable(f"argument{i}#") for i in range(op.arity)]
    build = Builder()
    with building(build):
        first = [as_node(partial) for partial in op.partials(output, *arguments)]
    zero, one = as_node(0.0), as_node(1.0)
    found = {}
    for k, argument in enumerate(arguments):
        dots = tangents({argument: one, output: first[k]}, first, build)
        found.update({(j, k): dots.get(first[j], zero) for j in range(k + 1)})
    return output, arguments, found
