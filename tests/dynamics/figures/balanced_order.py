"""What the balanced order of elimination costs and gains: nodes, depth, digits, and time by lanes and by threads.

python -m tests.dynamics.figures.balanced_order
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from heapq import heappop, heappush

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, folded, solve_nodes, topological
from dynamics.experiments.text_table import table
from dynamics.multibody.trees.mechanism import Mechanism
from tests.bench.tables import digits
from tests.dynamics.figures.parallel_c import times
from viz.paper.mechanisms import chain, turned_arm

MODELS: dict[str, Callable[[], Mechanism]] = {
    "planar 20": lambda: chain(0.2, 0.2, 20),
    "planar 50": lambda: chain(0.1, 0.1, 50),
    "planar 200": lambda: chain(0.1, 0.1, 200),
    "arm 30": lambda: turned_arm(30),
}
UNITS = (1, 4, 16, 64)  # that make an operation at a time each
ORDERS = ("recursive", "balanced")


def balanced_order(names: tuple[str, ...] = tuple(MODELS)) -> Iterator[str]:
    """Of M^-1 tau: nodes, depth, width; the operations one after another on some units; times of an evaluation [us]."""
    head = ("", "nodes", "depth", "width", *[f"{n} units" for n in UNITS])
    ways = ("plain", "4 lanes", "8 lanes", "1 thread", "2 threads")
    yield from table((*head, *ways), [row for name in names for row in rows(name)])


def rows(name: str) -> list[tuple[str, ...]]:
    """A row for each order, and one of what the second is of the first."""
    numbers = []
    for order in ORDERS:
        graph = trigonometry_given(solved(MODELS[name](), order))
        counts = graph.counts()
        count = len(graph.outputs)
        half = [node for node in graph.inputs if int(str(node.name).lstrip("abcdefghijklmnopqrstuvwxyz_")) < count // 2]
        measured = times(graph, half, [f"x{i}" for i in range(count // 2)])
        sums = [total for _, total in measured.values()]
        if max(sums) - min(sums) > 1e-9 * max(map(abs, sums)):
            raise RuntimeError(f"{name}, {order}: the ways of evaluation differ, their sums are {sums}")
        steps = [schedule(graph, units) for units in UNITS]
        numbers.append(
            [counts.nodes, counts.depth, counts.width, *steps, *[1e6 * took for took, _ in measured.values()]]
        )
    lines = [
        (f"{name}, {order}", *[str(n) if isinstance(n, int) else digits(n, 3) for n in row])
        for order, row in zip(ORDERS, numbers, strict=True)
    ]
    return [*lines, ("  ratio", *[f"{b / a:.2f}" for a, b in zip(*numbers, strict=True)])]


def solved(model: Mechanism, order: str) -> Graph:
    """M^-1 tau."""
    system = model.system
    x = solve_nodes(system.lagrangian, system.qd, system.tau, order="balanced" if order == "balanced" else "recursive")
    return cg.simplify(system.graph({f"x{i}": node for i, node in enumerate(x)}, system.q, system.tau))


def trigonometry_given(graph: Graph) -> Graph:
    """With cosines and sines as inputs c0.., s0.. in place of the coordinates: both orders take the same."""
    angles: dict[Node, int] = {}
    replace: dict[Node, Node] = {}
    for node in topological(graph.outputs.values()):
        if node.op.name in ("cos", "sin"):
            i = angles.setdefault(node.args[0], len(angles))
            replace[node] = cg.variable(f"{node.op.name[0]}{i}")
    outputs = folded(graph.outputs.values(), Builder(), replace)
    inputs = [*[node for node in graph.inputs if str(node.name)[:3] == "tau"], *replace.values()]
    return Graph(inputs, dict(zip(graph.outputs, outputs, strict=True)))


def schedule(graph: Graph, units: int) -> int:
    """Steps to evaluate a graph on so many units, each an operation a step, the longest way to an output first."""
    order = [node for node in topological(graph.outputs.values()) if node.args]
    height = dict.fromkeys(order, 0)
    for node in reversed(order):
        for arg in node.args:
            if arg.args:
                height[arg] = max(height[arg], height[node] + 1)
    missing = {node: len({arg for arg in node.args if arg.args}) for node in order}
    users: dict[Node, list[Node]] = {node: [] for node in order}
    for node in order:
        for arg in {arg for arg in node.args if arg.args}:
            users[arg].append(node)
    place = {node: k for k, node in enumerate(order)}
    ready: list[tuple[int, int]] = []
    for node in order:
        if not missing[node]:
            heappush(ready, (-height[node], place[node]))
    steps = 0
    while ready:
        steps += 1
        for _, k in [heappop(ready) for _ in range(min(units, len(ready)))]:
            for user in users[order[k]]:
                missing[user] -= 1
                if not missing[user]:
                    heappush(ready, (-height[user], place[user]))
    return steps


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in balanced_order(tuple(sys.argv[1:]) or tuple(MODELS)))
