"""The order in which `hessian_solve` takes the nodes: from the output down, rotations by one angle together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from heapq import heappop, heappush

from ..core.node import Node
from .rotation_pairs import Rotation

Step = Node | list[Rotation]


def steps(arguments: Mapping[Node, Collection[Node]], rotations: Mapping[Node, Rotation]) -> list[Step]:
    """Steps from the output down: a node, or rotations by one angle, once all that uses them is behind.

    arguments: {node: those that it hands its second-order adjoint to}, arguments first. A rotation is there once, by
    its first sum, and wherever either sum is an argument.

    Of the nodes that are ready the one last in `arguments` is taken; with a rotation, all ready ones by its angle. To
    take the one that leaves the fewest live saves an eighth of the nodes of a planar chain, but more of them wait for
    one another, and the machine code takes longer.
    """
    ordered = list(arguments)
    position = {node: i for i, node in enumerate(ordered)}
    uses = dict.fromkeys(ordered, 0)
    for args in arguments.values():
        for arg in args:
            uses[arg] += 1
    by_angle: dict[Node, dict[Node, None]] = {r.cos: {} for r in rotations.values()}  # the ready ones
    heap: list[int] = []

    def ready(node: Node) -> None:
        heappush(heap, -position[node])
        if node in rotations:
            by_angle[rotations[node].cos][node] = None

    for node, count in uses.items():
        if not count:
            ready(node)
    done: set[Node] = set()
    found: list[Step] = []
    while heap:
        node = ordered[-heappop(heap)]
        if node in done:
            continue
        taken = [node]
        if node in rotations:
            together = by_angle[rotations[node].cos]
            taken = list(together)
            together.clear()
            found.append([rotations[each] for each in taken])
        else:
            found.append(node)
        done.update(taken)
        for each in taken:
            for arg in arguments[each]:
                uses[arg] -= 1
                if not uses[arg]:
                    ready(arg)
    return found
