"""The order in which `hessian_solve` eliminates nodes: from the output down, rotations by one angle together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from heapq import heappop, heappush

from ..core.node import Node
from .rotation_pairs import Rotation

Step = Node | list[Rotation]


def elimination_steps(arguments: Mapping[Node, Collection[Node]], rotations: Mapping[Node, Rotation]) -> list[Step]:
    """Steps from the output down: a node, or rotations by one angle, once all nodes that use them are done.

    arguments: {node: those that its row of W t = b passes to}, arguments first. A rotation is there once, by its first
    sum, and wherever either sum is an argument.

    Of the nodes that are ready the one last in `arguments` is next; with a rotation, all ready ones by its angle. To
    take the one that leaves the fewest live saves an eighth of the nodes of a planar chain, but more of them wait for
    one another, and the machine code takes longer.
    """
    ordered = list(arguments)
    position = {node: i for i, node in enumerate(ordered)}
    uses = dict.fromkeys(ordered, 0)  # by nodes that are not done
    for args in arguments.values():
        for arg in args:
            uses[arg] += 1
    by_angle: dict[Node, dict[Node, None]] = {r.cos: {} for r in rotations.values()}  # rotations that are ready
    heap: list[int] = []

    def make_ready(node: Node) -> None:
        heappush(heap, -position[node])
        if node in rotations:
            by_angle[rotations[node].cos][node] = None

    for node, count in uses.items():
        if not count:
            make_ready(node)
    done: set[Node] = set()
    result: list[Step] = []
    while heap:
        node = ordered[-heappop(heap)]
        if node in done:  # with another rotation by its angle
            continue
        batch = [node]
        if node in rotations:
            same_angle = by_angle[rotations[node].cos]
            batch = list(same_angle)
            same_angle.clear()
            result.append([rotations[first] for first in batch])
        else:
            result.append(node)
        done.update(batch)
        for finished in batch:
            for arg in arguments[finished]:
                uses[arg] -= 1
                if not uses[arg]:
                    make_ready(arg)
    return result
