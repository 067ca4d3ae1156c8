"""Both forms of the equations of motion in one run, those of velocities and those of momenta, and their linearizations.

python -m tests.dynamics.figures.both_forms                  nodes, edges, depth, width, and times of an evaluation
python -m tests.dynamics.figures.both_forms linearizations   nodes and times of A and B
python -m tests.dynamics.figures.both_forms orders           M^-1 tau by both orders of elimination: also steps by units
"""

import sys
from collections.abc import Callable, Iterator
from functools import partial
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import solve_nodes, topological
from dynamics.equations.linearization.linearization import state_space
from dynamics.equations.momentum.hamiltonian import hamilton_equations, velocities
from dynamics.equations.state_equation import state_equation
from dynamics.experiments.text_table import table
from dynamics.experiments.timing import Timed, in_turns
from dynamics.systems.model import Model, as_system
from tests.bench.speed.scenes import SCENES, chain
from tests.bench.tables import digits
from tests.repeated import repeated

ROUNDS = 15  # of all forms in turn; the fastest counts
SECONDS = 0.02  # of a round
CALLS = 200  # between two looks at the clock
POINTS = 4096  # of a batch
STEP, PASSES = 1e-6, 5000  # s, of the steps of a loop, and how many: what is done before the first is not measured
COMPILED = 50_000  # nodes of a linearization; of more only the count, machine code would take minutes

Way = tuple[Callable[[], object], int]  # what is timed, and how many evaluations it makes

LARGER = ("planar 3", "planar 20", "planar 50", "arm 7", "arm 30", "tree 15", "free 35")
MODELS: dict[str, Callable[[], Model]] = {name: SCENES[name] for name in LARGER} | {
    "planar 200": lambda: chain(0.1, 0.1, 200)
}


class Figure(NamedTuple):
    """A table: models x forms x numbers.

    compiled: the largest graph that is timed.  units: that make an operation at a time each, steps on so many are told.
    """

    models: tuple[str, ...]
    forms: dict[str, Callable[[Model], Graph]]
    sizes: tuple[str, ...]
    ways: dict[str, Callable[[Graph], Way]]
    compiled: int = sys.maxsize
    units: tuple[int, ...] = ()

    @property
    def head(self) -> tuple[str, ...]:
        return (*self.sizes, *[f"{n} units" for n in self.units])


def called(graph: Graph) -> Way:
    compiled = cg.compile(graph)
    return compiled.bind(_point(graph), np.empty(compiled.n_out)), 1


def looped(graph: Graph) -> Way:
    """A loop of explicit Euler's steps."""
    state = graph.inputs[: len(graph.outputs)]
    moved = {f"{node.name}_next": node + STEP * rate for node, rate in zip(state, graph.outputs.values(), strict=True)}
    names, x = {str(node.name): f"{node.name}_next" for node in state}, _point(graph)
    loop = repeated(Graph(graph.inputs, moved), names)
    return lambda: loop(x, PASSES, PASSES), PASSES


def batched(graph: Graph) -> Way:
    compiled, out = cg.compile(graph), np.empty((len(graph.outputs), POINTS))
    aside = np.random.default_rng(1).uniform(-0.1, 0.1, (compiled.n_in, POINTS))
    points = np.ascontiguousarray(_point(graph)[:, np.newaxis] + aside)
    return lambda: compiled.batch(points, out=out), POINTS


def _point(graph: Graph) -> Array:
    return np.random.default_rng(0).uniform(-0.5, 0.5, len(graph.inputs))


def _jacobian(model: Model) -> Graph:
    """Of Hamilton's equations by coordinates and momenta, (nq + n, nq + n)."""
    equations, system = hamilton_equations(model), as_system(model)
    return cg.jacobian(equations, equations.inputs[: system.nq + system.n])


def _solved(order: str, model: Model) -> Graph:
    """M^-1 tau."""
    system = as_system(model)
    x = solve_nodes(system.lagrangian, system.qd, system.tau, order="balanced" if order == "balanced" else "recursive")
    return cg.simplify(system.graph({f"x{i}": node for i, node in enumerate(x)}, system.q, system.tau))


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


FIGURES = {
    "forms": Figure(
        ("planar 3", "planar 20", "planar 50", "planar 200", "arm 7", "arm 30", "tree 15", "free 35"),
        {"qdd": state_equation, "p": hamilton_equations, "qd": lambda model: velocities(as_system(model))},
        ("nodes", "edges", "depth", "width"),
        {"call us": called, "loop us": looped, "batch us": batched},
    ),
    "linearizations": Figure(
        ("planar 3", "planar 20", "arm 7", "arm 30", "tree 15", "free 35"),
        {"qd": state_space, "jacobian": _jacobian, "p": lambda model: state_space(model, form="momentum")},
        ("nodes",),
        {"call us": called},
        COMPILED,
    ),
    "orders": Figure(
        ("planar 20", "planar 50", "planar 200", "arm 30"),
        {order: partial(_solved, order) for order in ("recursive", "balanced")},
        ("nodes", "depth", "width"),
        {"call us": called, "batch us": batched},
        units=(1, 4, 16, 64),
    ),
}


def figure(name: str, models: tuple[str, ...] = (), rounds: int = ROUNDS) -> Iterator[str]:
    """A row for each form of each model, and one of what the form is of the first."""
    this = FIGURES[name]
    lines = [line for model in models or this.models for line in rows(this, model, rounds)]
    yield from table(("", *this.head, *this.ways), lines)


def rows(this: Figure, name: str, rounds: int = ROUNDS) -> list[tuple[str, ...]]:
    """Those of one model; no times where a graph is larger than what is compiled."""
    graphs = {form: derive(MODELS[name]()) for form, derive in this.forms.items()}
    sizes = [
        [*[getattr(graph.counts(), size) for size in this.sizes], *[schedule(graph, units) for units in this.units]]
        for graph in graphs.values()
    ]
    numbers: list[list[float]] = [[*each] for each in sizes]
    if max(len(graph.nodes) for graph in graphs.values()) <= this.compiled:
        for way in this.ways.values():
            for row, seconds in zip(
                numbers, least_seconds([way(each) for each in graphs.values()], rounds), strict=True
            ):
                row.append(1e6 * seconds)
    missing = ["-"] * (len(this.head) + len(this.ways) - len(numbers[0]))
    lines = []
    for form, size, row in zip(graphs, sizes, numbers, strict=True):
        lines.append((f"{name}, {form}", *map(str, size), *[digits(each, 3) for each in row[len(size) :]], *missing))
    for form, row in zip([*graphs][1:], numbers[1:], strict=True):
        ratios = [f"{b / a:.3f}" for a, b in zip(numbers[0], row, strict=True)]
        lines.append((f"  {form} / {next(iter(graphs))}", *ratios, *missing))
    return lines


def _called(run: Callable[[], object], times: int) -> None:
    for _ in range(times):
        run()


def least_seconds(ways: list[Way], rounds: int) -> list[float]:
    """Seconds of processor time an evaluation takes, the least of some rounds, all in turn."""
    calls = [CALLS if count == 1 else 1 for _, count in ways]
    runs = [Timed(partial(_called, run, n)) for (run, _), n in zip(ways, calls, strict=True)]
    in_turns(runs, rounds, SECONDS)
    return [min(each.processor) / (n * count) for each, n, (_, count) in zip(runs, calls, ways, strict=True)]


if __name__ == "__main__":
    words = sys.argv[1:]
    chosen = words.pop(0) if words[:1] and words[0] in FIGURES else "forms"
    sys.stdout.writelines(f"{line}\n" for line in figure(chosen, tuple(words)))
