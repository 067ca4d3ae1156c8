"""Second partial derivatives of the operations, derived once from the table and instantiated on demand."""

from __future__ import annotations

from typing import NamedTuple

from ..core.builder import Builder
from ..core.forward import tangents
from ..core.node import Node, as_node, variable
from ..core.row import Row
from ..core.scope import building
from ..core.traversal import topological
from ..util.caches import OPERATIONS, memo


class _Second(NamedTuple):
    """d2y / da_j da_k of an operation y(a), over placeholders: its nodes, arguments first, the result last."""

    j: int
    k: int
    nodes: list[Node]


def second_partials(node: Node, build: Builder) -> list[tuple[int, int, Node]]:
    """(j, k, d2y / da_j da_k) for y = node and its arguments a, j >= k, where it is not zero; nodes made by `build`.

    Arguments count as independent, also where one node stands in two slots.
    """
    output, arguments, seconds = _seconds_of(node.op)
    result = []
    for j, k, nodes in seconds:
        new = dict(zip(arguments, node.args, strict=True))
        new[output] = node
        for placeholder in nodes:  # put the operation's arguments in place of a, its output in place of y
            if placeholder not in new:
                args = tuple([new[arg] for arg in placeholder.args])
                new[placeholder] = build(placeholder.op, args, node.label) if args else placeholder
        if new[nodes[-1]].value != 0.0:
            result.append((j, k, new[nodes[-1]]))
    return result


@memo(OPERATIONS)
def _seconds_of(op: Row) -> tuple[Node, list[Node], list[_Second]]:
    """Placeholders for the output y and the arguments a of an operation, and its second partials over them."""
    output = variable("output#")
    arguments = [variable(f"argument{i}#") for i in range(op.arity)]
    build = Builder()
    with building(build):
        first = [as_node(partial) for partial in op.partials(output, *arguments)]
    one = as_node(1.0)
    # d2y/da_j da_k is the tangent of the partial dy/da_k in direction a_j; y itself moves by dy/da_j.
    seconds = []
    for j in range(op.arity):
        for k in range(j + 1):
            dots = tangents({arguments[j]: one, output: first[j]}, first, build)
            if first[k] in dots:
                seconds.append(_Second(j, k, topological([dots[first[k]]])))
    return output, arguments, seconds
