"""Stages of a model, from its Lagrangian to a result: what each one takes, by the clock, the processor and memory."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics.equations.equations_of_motion import bias, forward_dynamics, mass_matrix
from dynamics.equations.linearization.linearization import linearize_many
from dynamics.experiments.timing import Made, spent
from dynamics.multibody.builders import planar_arm
from dynamics.multibody.trees.mechanism import Mechanism
from dynamics.multiprecision.decimal_numbers import values_in_digits
from dynamics.systems.model import as_system
from tests.bench.tables import Table, digits
from tests.bench.timing import relative_difference, run_fresh
from tests.ldl import ldl_elimination
from viz.paper.mechanisms import turned_arm

COMPILED = (10, 30, 100)  # links of the chains of `compile_time`
LINKS = 1000  # of the chains of `long_chains`
STATES = 3  # of each chain whose errors are taken
SIZES = (("planar", 10), ("planar", 100), ("planar", 300), ("3D", 10), ("3D", 100))
DENSE = {"planar": 30, "3D": 10}  # links; beyond, the graph of the dense solve, which grows with n^3, takes long
COLUMNS = ["chain", "bodies", "nodes", "graph", "code", "a body", "Jacobian", "a body", "A and B", "an entry"]
TITLE = """\
Seconds of the processor from the model to a first result, every chain in a process of its own.
graph, code: forward dynamics as a graph, and compiled.  Jacobian: by q, qd and tau, of the compiled function.
A and B: `linearize_many`, 6 n^2 entries.  a body, an entry: in ms, of graph and code, the Jacobian, and A and B."""


class Stages(dict[str, tuple[float, float, float]]):
    """Seconds by the clock and of the processor, and the peak of memory [MB], 0 on Windows, of each stage by name."""

    def __call__(self, name: str, function: Callable[[], Made]) -> Made:
        taken = spent(function)
        self[name] = taken.seconds, taken.processor, _peak()
        return taken.made


def _peak() -> float:
    if sys.platform == "win32":
        return 0.0
    import resource  # not on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def planar(n: int) -> Mechanism:
    """A planar chain of unlike rods."""
    masses, lengths = [0.2 + 0.05 * (i % 3) for i in range(n)], [0.2 + 0.1 * (i % 2) for i in range(n)]
    return planar_arm(masses, lengths, damping=0.1)


MODELS: dict[str, Callable[[int], Mechanism]] = {"planar": planar, "3D": turned_arm}


def compile_time(links: int | None = None) -> Iterator[Table]:
    """A row a chain: time until forward dynamics and its derivatives have a result.  links: of this length alone."""
    sizes = COMPILED if links is None else (links,)
    rows = [[kind, str(n), *_fresh("compile_cost", kind, n)] for kind in MODELS for n in sizes]
    yield Table(TITLE, COLUMNS, rows)


def long_chains(links: int = LINKS, sizes: Sequence[tuple[str, int]] = SIZES) -> Iterator[Table | str]:
    """Cost of chains of so many links, each in a process of its own; then accuracy, which needs mpmath."""
    for kind in MODELS:
        *rows, size = _fresh("cost", kind, links)
        yield Table(f"{kind} chain of {links} links", ["stage", "clock", "processor", "peak"], rows)
        yield size
    for kind, n in sizes:
        for spread in (np.pi, 0.1):
            errors = ",  ".join(f"{name} {error:.1e}" for name, error in accuracy(kind, n, spread).items())
            yield f"largest relative error, {kind} {n} links, |q| < {spread:4.2f}:  {errors}"


def _fresh(function: str, kind: str, n: int) -> Any:
    """What a function below says of a chain, in a process of its own."""
    try:
        return run_fresh(__name__, function, kind, n)
    except RuntimeError as error:
        raise RuntimeError(f"{kind} chain of {n} links: {error}") from None


def compile_cost(kind: str, n: int) -> list[str]:
    """One chain's cells of `compile_time`."""
    model, stages = MODELS[kind](n), Stages()
    cg.compile(cg.Graph([cg.variable("x")], {"y": cg.variable("x")}))([0.0])  # LLVM is loaded
    graph = stages("graph", lambda: forward_dynamics(model))
    x = np.random.default_rng(n).normal(size=len(graph.inputs))

    def called() -> cg.Compiled:
        function = cg.compile(graph)
        function(x)
        return function

    function = stages("code", called)
    stages("Jacobian", lambda: function.jacobian(x))
    stages("A and B", lambda: linearize_many(model, *[part[None] for part in np.split(x, 3)]))
    derived, compiled, jacobian, matrices = [processor for _, processor, _ in stages.values()]
    each = 1e3 * (derived + compiled) / n, 1e3 * jacobian / n, 1e3 * matrices / (6 * n * n)
    shown = [derived, compiled, each[0], jacobian, each[1], matrices, each[2]]
    return [str(len(graph.nodes)), *[digits(value, 2) for value in shown]]


def cost(kind: str, n: int) -> list[list[str] | str]:
    """Time on the clock, that of the processor, and the peak memory after the stages of one chain; then its size."""
    model, stages = MODELS[kind](n), Stages()
    stages("numpy and the library, imported", lambda: None)
    stages("Lagrangian", lambda: as_system(model).lagrangian)
    graph = stages("forward dynamics", lambda: forward_dynamics(model))
    x = np.random.default_rng(n).normal(size=len(graph.inputs))
    at = dict(zip(graph.input_names, x.tolist(), strict=True))
    evaluated = np.array(list(stages("evaluate", lambda: graph.evaluate(at)).values()))
    run = stages("compile", lambda: cg.compile(graph))
    compiled = stages("first call", lambda: run(x))
    stages("second call", lambda: run(x))
    rows: list[list[str] | str] = [
        [name, f"{clock:.3f} s", f"{processor:.3f} s", f"{peak:.0f} MB"]
        for name, (clock, processor, peak) in stages.items()
    ]
    apart, count = relative_difference(compiled, evaluated), len(graph.nodes)
    return [*rows, f"{count} nodes, {count / n:.0f} a link; compiled and evaluated differ by {apart:.1e}"]


def accuracy(kind: str, n: int, spread: float) -> dict[str, float]:
    """Largest error relative to the largest entry, by way of solving, over states with angles within +-spread.

    Beside the elimination in 100 digits.
    """
    model, rng = MODELS[kind](n), np.random.default_rng(n)
    graphs = {"elimination": forward_dynamics(model, "recursive")}
    if n <= DENSE[kind]:
        graphs["dense LDL, graph"] = forward_dynamics(model, "dense")
    matrix, biases = mass_matrix(model) if n <= 100 else None, bias(model)
    worst: dict[str, float] = {}
    for _ in range(STATES):
        q, qd, tau = rng.uniform(-spread, spread, n), rng.normal(size=n), rng.normal(size=n)
        state = dict(zip(graphs["elimination"].input_names, [*q, *qd, *tau], strict=True))
        exact = np.array(values_in_digits(graphs["elimination"], [*q, *qd, *tau], 100), dtype=np.float64)
        solved: dict[str, Array] = {name: values(graph, state) for name, graph in graphs.items()}
        if matrix is not None:
            m = values(matrix, state).reshape(n, n)
            rhs = tau - values(biases, state) - np.array(as_system(model).damping) * qd
            solved |= {
                "numpy.linalg.solve": np.asarray(np.linalg.solve(m, rhs), dtype=np.float64),
                "LDL of the same, floats": np.array(ldl_elimination(m.tolist(), rhs.tolist())[0]),
            }
        for name, x in solved.items():
            worst[name] = max(worst.get(name, 0.0), relative_difference(x, exact))
    return worst


def values(graph: cg.Graph, state: dict[str, float]) -> Array:
    """The outputs, from what of the state the graph needs."""
    return np.array(list(graph.evaluate({name: state[name] for name in graph.input_names}).values()))
