"""The elimination step by step: pivots from the tip to the base, back out, and then the rates of the momenta."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from cgraph import Graph, Node
from cgraph.extend import topological


class EliminationStep(NamedTuple):
    """words: what is done.  nodes: what is computed in it, not before.  value: its result.  coordinate: whose."""

    words: str
    nodes: tuple[Node, ...]
    value: Node
    coordinate: int


def elimination(graph: Graph, names: Mapping[str, str]) -> list[EliminationStep]:
    """The steps of forward dynamics, or of Hamilton's equations where velocities are rates of coordinates.

    A pivot is what an acceleration or a velocity is divided by: the inertia that its joint feels while all joints
    further out follow freely. It is a node like others, known by what is divided by it. [] for a graph that divides by
    no pivots.

    names: {name in the graph: what a person calls it}.
    """
    rates = _numbered(graph, "p", "_dot")
    kind, solved = ("velocity", _numbered(graph, "q", "_dot")) if rates else ("acceleration", _numbered(graph, "qdd"))
    every = {node for _, node in solved.values()}
    place = {node: i for i, node in enumerate(graph.nodes)}
    found = {i: _pivot(node, every, place) for i, (_, node) in solved.items()}
    pivots = {i: pivot for i, pivot in found.items() if pivot is not None}
    if len(pivots) < len(solved) or (rates and rates.keys() != solved.keys()):
        return []
    joints = {i: names.get(name, name).partition(".")[2] or name for i, (name, _) in solved.items()}
    done = {node for node in graph.nodes if not node.args}
    steps: list[EliminationStep] = []

    def add(words: str, value: Node, i: int) -> None:
        fresh = tuple([node for node in topological([value]) if node not in done])
        done.update(fresh)
        steps.append(EliminationStep(words, fresh, value, i))

    for i, pivot in sorted(pivots.items(), key=lambda each: (bool(each[1].args), place[each[1]], -each[0])):
        words = f"Eliminate {joints[i]}: its pivot is the inertia that it feels while all joints further out follow."
        add(words, pivot, i)
    how = "nothing else is unknown at the base"
    for i, (_, node) in sorted(solved.items(), key=lambda each: place[each[1][1]]):
        add(f"Back out: the {kind} of {joints[i]}; {how}.", node, i)
        how = "what moves it from below is known now"
    for i, (_, node) in sorted(rates.items(), reverse=True):
        add(f"All velocities are known: the rate of the momentum of {joints[i]}.", node, i)
    return steps


def _numbered(graph: Graph, kind: str, end: str = "") -> dict[int, tuple[str, Node]]:
    """{number: (name, node)} of the outputs of a kind, such as q0_dot, q1_dot .."""
    found = {}
    for name, node in graph.outputs.items():
        number = name.removeprefix(kind).removesuffix(end)
        if number.isdecimal() and name == f"{kind}{number}{end}":
            found[int(number)] = (name, node)
    return found


def _pivot(solved: Node, others: set[Node], place: Mapping[Node, int]) -> Node | None:
    """The first of the divisors that are met below what is solved for, before a division or another of it.

    What of the joints further in is met, too, was divided by their pivots, which come later.
    """
    found: list[Node] = []
    rest, seen = [solved], {solved}
    while rest:
        node = rest.pop()
        if node.op.name == "div":
            found.append(node.args[1])
            continue
        below = [arg for arg in node.args if arg not in others and arg not in seen]
        rest += below
        seen.update(below)
    return min(found, key=lambda node: (bool(node.args), place[node]), default=None)
