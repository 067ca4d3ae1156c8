"""The linearizations of both forms in one run, and the Jacobian of Hamilton's equations: nodes, and times of a call.

python -m dynamics.experiments.speed.both_linearizations
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator

import numpy as np

import cgraph as cg
from cgraph import Graph

from ...equations.hamiltonian import hamilton_equations
from ...equations.linearization import state_space
from ...multibody.mechanism import Mechanism
from ..text_table import digits, table
from .both_forms import MODELS, ROUNDS, SECONDS

NAMES = ("planar 3", "planar 20", "arm 7", "arm 30", "tree 15", "free 35")
COMPILED = 50_000  # nodes; of more only the count, machine code would take minutes


def jacobian(model: Mechanism) -> Graph:
    """Of Hamilton's equations by coordinates and momenta, (nq + n, nq + n)."""
    equations, system = hamilton_equations(model), model.system
    return cg.jacobian(equations, equations.inputs[: system.nq + system.n])


FORMS: dict[str, Callable[[Mechanism], Graph]] = {
    "qd": state_space,
    "jacobian": jacobian,
    "p": lambda model: state_space(model, form="momentum"),
}


def both_linearizations(names: tuple[str, ...] = NAMES, rounds: int = ROUNDS) -> Iterator[str]:
    """Nodes and times of a bound call [us] of each, and those of the momentum form over the two others."""
    head = ("", *FORMS, *[f"p / {form}" for form in ("qd", "jacobian")])
    yield from table(head, [row for name in names for row in rows(name, rounds)])


def rows(name: str, rounds: int = ROUNDS) -> list[tuple[str, ...]]:
    """A row of nodes, and one of times where all of them are compiled."""
    graphs = [derive(MODELS[name]()) for derive in FORMS.values()]
    nodes = [len(graph.nodes) for graph in graphs]
    lines = [(f"{name}, nodes", *map(str, nodes), *_ratios(nodes))]
    if max(nodes) <= COMPILED:
        times = _times([_call(graph) for graph in graphs], rounds)
        lines.append((f"{name}, us", *[digits(1e6 * each, 3) for each in times], *_ratios(times)))
    return lines


def _ratios(numbers: list[int] | list[float]) -> list[str]:
    return [f"{numbers[2] / number:.3f}" for number in numbers[:2]]


def _call(graph: Graph) -> Callable[[], object]:
    compiled = cg.compile(graph)
    x = np.random.default_rng(0).uniform(-0.5, 0.5, compiled.n_in)
    return compiled.bind(x, np.empty(compiled.n_out))


def _times(runs: list[Callable[[], object]], rounds: int) -> list[float]:
    """Seconds of processor time a call takes, the least of some rounds, all in turn."""
    best = [np.inf] * len(runs)
    for _ in range(rounds):
        for k, run in enumerate(runs):
            calls, begin = 0, time.process_time()
            while (taken := time.process_time() - begin) < SECONDS:
                for _ in range(20):
                    run()
                calls += 20
            best[k] = min(best[k], taken / calls)
    return best


if __name__ == "__main__":
    sys.stdout.writelines(f"{line}\n" for line in both_linearizations(tuple(sys.argv[1:]) or NAMES))
