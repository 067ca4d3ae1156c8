"""Long chains: what forward dynamics of a thousand links costs to build and run, and how accurate long chains are."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

import cgraph as cg
from cgraph.extend import Array, ldl_elimination

from ...equations.equations_of_motion import bias, forward_dynamics, mass_matrix
from ...multibody.mechanism import Mechanism
from ...multibody.planar_arm import planar_arm
from ...multiprecision.planar_arm_equations import accelerations
from ...multiprecision.spatial_chain_equations import chain_accelerations
from ...systems.model import as_system
from ..fresh_process import run_fresh
from ..text_table import table
from .bench_scenes import turned_arm

LINKS = 1000
STATES = 3  # of each chain
SIZES = (("planar", 10), ("planar", 100), ("planar", 300), ("3D", 10), ("3D", 100))
DENSE = {"planar": 30, "3D": 10}  # links; beyond, the graph of the dense solve, which grows with n^3, takes long

Made = TypeVar("Made")


def planar(n: int) -> Mechanism:
    """A planar chain of unlike rods."""
    masses, lengths = [0.2 + 0.05 * (i % 3) for i in range(n)], [0.2 + 0.1 * (i % 2) for i in range(n)]
    return planar_arm(masses, lengths, damping=0.1)


MODELS: dict[str, Callable[[int], Mechanism]] = {"planar": planar, "3D": turned_arm}
EXACT: dict[str, Callable[..., Array]] = {
    "planar": lambda *at: accelerations(*at).high,
    "3D": chain_accelerations,
}


def long_chains(links: int = LINKS) -> Iterator[str]:
    """Cost of chains of so many links, each in a process of its own; then accuracy, which needs python-flint."""
    for kind in MODELS:
        done = run_fresh(__name__, f"cost({kind!r}, {links})")
        if done.returncode:
            raise RuntimeError(f"{kind} chain of {links} links: {done.stderr.strip()[-200:]}")
        yield f"{kind} chain of {links} links\n{done.stdout.rstrip()}"
    for kind, n in SIZES:
        for spread in (np.pi, 0.1):
            errors = ",  ".join(f"{name} {error:.1e}" for name, error in accuracy(kind, n, spread).items())
            yield f"largest relative error, {kind} {n} links, |q| < {spread:4.2f}:  {errors}"


def cost(kind: str, n: int) -> None:
    """Write the time on the clock, that of the processor, and the peak memory after the stages of one chain."""
    import resource  # not on Windows

    rows: list[list[str]] = []

    def stage(what: str, function: Callable[[], Made]) -> Made:
        begin, worked = time.perf_counter(), time.process_time()
        result = function()
        seconds, worked = time.perf_counter() - begin, time.process_time() - worked
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
        rows.append([what, f"{seconds:.3f} s", f"{worked:.3f} s", f"{peak:.0f} MB"])
        return result

    model = MODELS[kind](n)
    stage("numpy and the library, imported", lambda: None)
    stage("Lagrangian", lambda: as_system(model).lagrangian)
    graph = stage("forward dynamics", lambda: forward_dynamics(model))
    x = np.random.default_rng(n).normal(size=len(graph.inputs))
    values = dict(zip(graph.input_names, x.tolist(), strict=True))
    evaluated = np.array(list(stage("evaluate", lambda: graph.evaluate(values)).values()))
    run = stage("compile", lambda: cg.compile(graph))
    compiled = stage("first call", lambda: run(x))
    stage("second call", lambda: run(x))
    apart = np.abs(evaluated - compiled).max() / np.abs(evaluated).max()
    size = f"{len(graph.nodes)} nodes, {len(graph.nodes) / n:.0f} a link; compiled and evaluated differ by {apart:.1e}"
    sys.stdout.write("\n".join([*table(["stage", "clock", "processor", "peak"], rows), size]))


def accuracy(kind: str, n: int, spread: float) -> dict[str, float]:
    """Largest error relative to the largest entry, by way of solving, over states with angles within +-spread."""
    model, rng = MODELS[kind](n), np.random.default_rng(n)
    graphs = {"elimination": forward_dynamics(model, "recursive")}
    if n <= DENSE[kind]:
        graphs["dense LDL, graph"] = forward_dynamics(model, "dense")
    matrix, biases = mass_matrix(model) if n <= 100 else None, bias(model)
    worst: dict[str, float] = {}
    for _ in range(STATES):
        q, qd, tau = rng.uniform(-spread, spread, n), rng.normal(size=n), rng.normal(size=n)
        exact = EXACT[kind](model, q, qd, tau)
        state = dict(zip(graphs["elimination"].input_names, [*q, *qd, *tau], strict=True))
        solved: dict[str, Array] = {name: values(graph, state) for name, graph in graphs.items()}
        if matrix is not None:
            m = values(matrix, state).reshape(n, n)
            rhs = tau - values(biases, state) - np.array(as_system(model).damping) * qd
            solved |= {
                "numpy.linalg.solve": np.asarray(np.linalg.solve(m, rhs), dtype=np.float64),
                "LDL of the same, floats": np.array(ldl_elimination(m.tolist(), rhs.tolist())[0]),
            }
        for name, x in solved.items():
            worst[name] = max(worst.get(name, 0.0), float(np.abs(x - exact).max() / np.abs(exact).max()))
    return worst


def values(graph: cg.Graph, state: dict[str, float]) -> Array:
    """The outputs, from what of the state the graph needs."""
    return np.array(list(graph.evaluate({name: state[name] for name in graph.input_names}).values()))
