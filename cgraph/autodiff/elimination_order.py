"""The order in which `hessian_solve` eliminates nodes: from the output down, rotations by one angle together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from heapq import heappop, heappush

from ..core.node import Node
from .rotation_pairs import Rotation

EliminationStep = Node | list[Rotation]


def elimination_steps(
    arguments: Mapping[Node, Collection[Node]], rotations: Mapping[Node, Rotation], *, fewest: bool = False
) -> list[EliminationStep]:
    """Steps from the output down: a node, or rotations by one angle, once all nodes that use them are done.

    arguments: {node: those that its row of W t = b passes to}, arguments first. A rotation is there once, by its first
    sum, and wherever either sum is an argument.

    Of the nodes that are ready the one last in `arguments` is next; with a rotation, all ready ones by its angle. To
    take the one that leaves the fewest live, `fewest`, saves an eighth of the nodes of a planar chain, but more of them
    wait for one another, and the machine code takes longer. Between bodies fewer unknowns are left.
    """
    ordered = list(arguments)
    position = {node: i for i, node in enumerate(ordered)}
    users: dict[Node, list[Node]] = {node: [] for node in ordered}
    for node, args in arguments.items():
        for arg in args:
            users[arg].append(node)
    uses = {node: len(by) for node, by in users.items()}  # by nodes that are not done
    new = {node: len(args) for node, args in arguments.items()}  # arguments that are not live
    live: set[Node] = set()  # what a node that is done passes to
    by_angle: dict[object, dict[Node, None]] = {r.angle: {} for r in rotations.values()}  # rotations that are ready
    heap: list[tuple[int, int]] = []

    def push(node: Node) -> None:
        heappush(heap, (new[node] - (node in live) if fewest else 0, -position[node]))

    def make_ready(node: Node) -> None:
        push(node)
        if node in rotations:
            by_angle[rotations[node].angle][node] = None

    def pass_to(arg: Node) -> None:
        if fewest and arg not in live:
            live.add(arg)
            for user in users[arg]:
                new[user] -= 1
                if not uses[user] and user not in done:
                    push(user)
        uses[arg] -= 1
        if not uses[arg]:
            make_ready(arg)

    done: set[Node] = set()
    result: list[EliminationStep] = []
    for node in ordered:
        if not uses[node]:
            make_ready(node)
    while heap:
        node = ordered[-heappop(heap)[1]]
        if node in done:  # with another rotation by its angle, or by a better place
            continue
        batch = [node]
        if node in rotations:
            same_angle = by_angle[rotations[node].angle]
            batch = list(same_angle)
            same_angle.clear()
            result.append([rotations[first] for first in batch])
        else:
            result.append(node)
        done.update(batch)
        for finished in batch:
            for arg in arguments[finished]:
                pass_to(arg)
    return result


def nodes_of(step: EliminationStep) -> list[Node]:
    """The nodes of a step."""
    return [node for r in step for node in (r.first, r.second)] if isinstance(step, list) else [step]
