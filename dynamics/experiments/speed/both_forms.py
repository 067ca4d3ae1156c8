"""Both forms of the equations of motion in one run: the graph of accelerations and that of Hamilton's equations.

And the velocities of the momenta alone, an elimination that the second cannot do without and that the first has too.

python -m dynamics.experiments.speed.both_forms
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Array

from ...equations.hamiltonian import hamilton_equations, velocities
from ...equations.state_equation import state_equation
from ...multibody.mechanism import Mechanism
from ...multibody.planar_arm import planar_arm
from ..text_table import digits, table
from .bench_scenes import binary_tree, chain, free_tree, turned_arm

MODELS: dict[str, Callable[[], Mechanism]] = {
    "planar 3": lambda: planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1),
    "planar 20": lambda: chain(0.2, 0.2, 20),
    "planar 50": lambda: chain(0.1, 0.1, 50),
    "planar 200": lambda: chain(0.1, 0.1, 200),
    "arm 7": lambda: turned_arm(7),
    "arm 30": lambda: turned_arm(30),
    "tree 15": lambda: binary_tree(15),
    "free 35": lambda: free_tree(35),
}
FORMS: dict[str, Callable[[Mechanism], Graph]] = {
    "qdd": state_equation,
    "p": hamilton_equations,
    "qd": lambda model: velocities(model.system),
}
ROUNDS = 15  # of all forms in turn; the fastest counts
SECONDS = 0.02  # of a round
POINTS = 4096  # of a batch
STEP, PASSES = 1e-6, 5000  # s, of the steps of a loop, and how many: what is done before the first is not measured


def both_forms(names: tuple[str, ...] = tuple(MODELS), rounds: int = ROUNDS) -> Iterator[str]:
    """Nodes, edges, depth, width; times of a bound call, a pass of a loop and a state of a batch [us]; and ratios."""
    yield from table(
        ("", "nodes", "edges", "depth", "width", "call us", "loop us", "batch us"),
        [row for name in names for row in rows(name, rounds)],
    )


def rows(name: str, rounds: int = ROUNDS) -> list[tuple[str, ...]]:
    """A row for each form, and those of what the others are of the first."""
    graphs = {form: derive(MODELS[name]()) for form, derive in FORMS.items()}
    counts = [graph.counts() for graph in graphs.values()]
    sizes = [(each.nodes, each.edges, each.depth, each.width) for each in counts]
    times = _times([ways(graph) for graph in graphs.values()], rounds)
    lines = [
        (f"{name}, {form}", *map(str, size), *[digits(1e6 * each, 3) for each in measured])
        for form, size, measured in zip(graphs, sizes, times, strict=True)
    ]
    first, *others = [(*size, *measured) for size, measured in zip(sizes, times, strict=True)]
    for form, row in zip(list(FORMS)[1:], others, strict=True):
        lines.append((f"  {form} / qdd", *[f"{b / a:.3f}" for a, b in zip(first, row, strict=True)]))
    return lines


def ways(graph: Graph) -> list[tuple[Callable[[], object], int]]:
    """A bound call, a loop of explicit Euler's steps, and a batch; and how many evaluations each makes."""
    compiled, rng = cg.compile(graph), np.random.default_rng(0)
    x = rng.uniform(-0.5, 0.5, compiled.n_in)
    points = np.ascontiguousarray(x[:, np.newaxis] + rng.uniform(-0.1, 0.1, (compiled.n_in, POINTS)))
    out: Array = np.empty((compiled.n_out, POINTS))
    state = graph.inputs[: compiled.n_out]
    moved = {f"{node.name}_next": node + STEP * rate for node, rate in zip(state, graph.outputs.values(), strict=True)}
    loop = cg.loop(Graph(graph.inputs, moved), {str(node.name): f"{node.name}_next" for node in state})
    return [
        (compiled.bind(x, np.empty(compiled.n_out)), 1),
        (lambda: loop(x, PASSES, PASSES), PASSES),
        (lambda: compiled.batch(points, out=out), POINTS),
    ]


def _times(forms: list[list[tuple[Callable[[], object], int]]], rounds: int) -> list[list[float]]:
    """Seconds of processor time an evaluation takes, the least of some rounds, all forms in turn."""
    best = [[np.inf] * len(ways) for ways in forms]
    for _ in range(rounds):
        for k in range(len(best[0])):
            for row, ways in zip(best, forms, strict=True):
                run, count = ways[k]
                calls, begin = 0, time.process_time()
                while (taken := time.process_time() - begin) < SECONDS:
                    for _ in range(50 if count == 1 else 1):
                        run()
                    calls += 50 if count == 1 else 1
                row[k] = min(row[k], taken / (calls * count))
    return best


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in both_forms(tuple(sys.argv[1:]) or tuple(MODELS)))
