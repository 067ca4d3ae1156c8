"""Second partial derivatives of the operations, derived once from their rows and put in place of need."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from ..core.node import Node, Op, as_node, variable
from ..core.scope import building
from ..core.traversal import topological
from ..simplify.builder import Builder
from .forward import tangents


class _Second(NamedTuple):
    """A second partial that is not zero, over placeholders: its nodes, arguments first; the last of them is it."""

    j: int
    k: int
    nodes: list[Node]


def second_partials(node: Node, build: Builder) -> list[tuple[int, int, Node]]:
    """(j, k, d2 node / d args[j] d args[k]) for j >= k where it is not zero, the arguments taken as independent.

    The derivatives are nodes made by `build`.
    """
    output, arguments, seconds = _seconds_of(node.op)
    found = []
    for j, k, nodes in seconds:
        new = dict(zip(arguments, node.args, strict=True))
        new[output] = node
        for each in nodes:
            if each not in new:
                args = tuple([new[arg] for arg in each.args])
                new[each] = build(each.op, args, node.label) if args else each
        if new[nodes[-1]].value != 0.0:
            found.append((j, k, new[nodes[-1]]))
    return found


@cache
def _seconds_of(op: Op) -> tuple[Node, list[Node], list[_Second]]:
    """Placeholders for the output and the arguments of an operation, and its second partials over them."""
    output = variable("output#")
    arguments = [variable(f"argument{i}#") for i in range(op.arity)]
    build = Builder()
    with building(build):
        first = [as_node(partial) for partial in op.partials(output, *arguments)]
    one = as_node(1.0)
    found = []
    for j in range(op.arity):
        for k in range(j + 1):
            dots = tangents({arguments[j]: one, output: first[j]}, first, build)
            if first[k] in dots:
                found.append(_Second(j, k, topological([dots[first[k]]])))
    return output, arguments, found
