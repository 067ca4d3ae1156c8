"""The elimination in forward dynamics, step by step: pivots from the tip to the base, then accelerations back out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from cgraph import Graph, Node
from cgraph.extend import topological

OUTPUT = "qdd"


class EliminationStep(NamedTuple):
    """words: what is done.  nodes: what is computed in it, not before.  value: its result.  coordinate: whose."""

    words: str
    nodes: tuple[Node, ...]
    value: Node
    coordinate: int


def elimination(graph: Graph, names: Mapping[str, str]) -> list[EliminationStep]:
    """The steps of forward dynamics of n coordinates; [] for a graph that divides by no pivots.

    A pivot is what an acceleration is divided by: the inertia that its joint feels while all joints further out follow
    freely. It is a node like others, known by what is divided by it.

    names: {name in the graph: what a person calls it}.
    """
    accelerations = {name: node for name, node in graph.outputs.items() if name.startswith(OUTPUT)}
    every = set(accelerations.values())
    place = {node: i for i, node in enumerate(graph.nodes)}
    found = {name: _pivot(node, every, place) for name, node in accelerations.items()}
    pivots = {name: pivot for name, pivot in found.items() if pivot is not None}
    if len(pivots) < len(accelerations):
        return []
    done = {node for node in graph.nodes if not node.args}
    steps: list[EliminationStep] = []

    def add(words: str, value: Node, name: str) -> None:
        fresh = tuple([node for node in topological([value]) if node not in done])
        done.update(fresh)
        steps.append(EliminationStep(words, fresh, value, int(name.removeprefix(OUTPUT))))

    for name, pivot in sorted(
        pivots.items(), key=lambda each: (bool(each[1].args), place[each[1]], -int(each[0].removeprefix(OUTPUT)))
    ):
        joint = names.get(name, name).partition(".")[2] or name
        add(
            f"Eliminate {joint}: its pivot is the inertia that it feels while all joints further out follow.",
            pivot,
            name,
        )
    first = True
    for name, node in sorted(accelerations.items(), key=lambda each: place[each[1]]):
        joint = names.get(name, name).partition(".")[2] or name
        how = "nothing else is unknown at the base" if first else "what moves it from below is known now"
        add(f"Back out: the acceleration of {joint}; {how}.", node, name)
        first = False
    return steps


def _pivot(acceleration: Node, others: set[Node], place: Mapping[Node, int]) -> Node | None:
    """The first of the divisors that are met below an acceleration, before a division or another acceleration.

    What of the joints further in is met, too, was divided by their pivots, which come later.
    """
    found: list[Node] = []
    rest, seen = [acceleration], {acceleration}
    while rest:
        node = rest.pop()
        if node.op.name == "div":
            found.append(node.args[1])
            continue
        below = [arg for arg in node.args if arg not in others and arg not in seen]
        rest += below
        seen.update(below)
    return min(found, key=lambda node: (bool(node.args), place[node]), default=None)
