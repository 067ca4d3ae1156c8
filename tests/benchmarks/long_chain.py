"""Chains of 1000 links, and how accurate long chains are: `python tests/benchmarks/long_chain.py [size | accuracy]`.

`size` builds, evaluates and compiles forward dynamics of a planar and a 3D chain, each in a process of its own, and
prints the time and the peak memory after every stage. `accuracy` compares accelerations with a dense solve in 60 digits
or more (needs python-flint). Times are of this machine, one run; nothing is asserted.
"""

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import numpy as np

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.speed.bench_scenes import turned_arm
from dynamics.reference.planar_arm_equations import accelerations
from tests.dynamics.dense_reference import chain_accelerations


def planar(n: int) -> dyn.Mechanism:
    """A planar chain of unlike rods."""
    return dyn.planar_arm(
        [0.2 + 0.05 * (i % 3) for i in range(n)], [0.2 + 0.1 * (i % 2) for i in range(n)], damping=0.1
    )


MODELS = {"planar": planar, "3D": turned_arm}
REFERENCES = {"planar": lambda *at: accelerations(*at).high, "3D": chain_accelerations}
CASES = [("planar", 10), ("planar", 100), ("planar", 300), ("3D", 10), ("3D", 100)]


def stage(what: str, function: Callable[[], object]) -> object:
    """Run it; print the time on the clock, that of the processor, and the peak memory so far."""
    start, worked = time.perf_counter(), time.process_time()
    result = function()
    seconds, worked = time.perf_counter() - start, time.process_time() - worked
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    print(f"  {what:34} {seconds:9.3f} s   processor {worked:9.3f} s   peak {peak:6.0f} MB", flush=True)
    return result


def size(kind: str, n: int, backend: str) -> None:
    """One chain from its links to its accelerations."""
    model = MODELS[kind](n)
    stage("numpy and the library, imported", lambda: None)
    stage("Lagrangian", lambda: model.system.lagrangian)
    graph = stage("forward dynamics", lambda: dyn.forward_dynamics(model))
    print(f"  {len(graph.nodes)} nodes, {len(graph.nodes) / n:.0f} a link")
    x = np.random.default_rng(n).normal(size=len(graph.inputs))
    values = dict(zip(graph.input_names, x.tolist(), strict=True))
    found = np.array(list(stage("evaluate", lambda: graph.evaluate(values)).values()))
    run = stage(f'compile, backend="{backend}"', lambda: cg.compile(graph, backend=backend))
    compiled = stage("first call", lambda: run(x))
    stage("second call", lambda: run(x))
    print(f"  compiled and evaluated differ by {np.abs(found - compiled).max() / np.abs(found).max():.1e}, relative")


def accuracy(kind: str, n: int, spread: float, states: int = 3) -> None:
    """Largest error relative to the largest entry, over some states with joint angles within +-spread."""
    model, rng = MODELS[kind](n), np.random.default_rng(n)
    graphs = {"elimination": dyn.forward_dynamics(model, "recursive")}
    if n <= 10 or (kind == "planar" and n <= 30):  # beyond, the graph grows with n^3
        graphs["dense LDL, graph"] = dyn.forward_dynamics(model, "dense")
    matrix, bias = dyn.mass_matrix(model) if n <= 100 else None, dyn.bias(model)
    worst: dict[str, float] = {}
    for _ in range(states):
        q, qd, tau = rng.uniform(-spread, spread, n), rng.normal(size=n), rng.normal(size=n)
        exact = REFERENCES[kind](model, q, qd, tau)
        state = dict(zip(graphs["elimination"].input_names, [*q, *qd, *tau], strict=True))
        found = {name: np.array(list(graph.evaluate(state).values())) for name, graph in graphs.items()}
        if matrix is not None:
            at = {name: state[name] for name in matrix.input_names}
            m = np.reshape(list(matrix.evaluate(at).values()), (n, n))
            rhs = tau - np.array(list(bias.evaluate(at).values())) - np.array(model.system.damping) * qd
            found["numpy.linalg.solve"] = np.linalg.solve(m, rhs)
            found["LDL of the same, floats"] = ldl(m, rhs)
        for name, value in found.items():
            worst[name] = max(worst.get(name, 0.0), float(np.abs(value - exact).max() / np.abs(exact).max()))
    print(f"{kind:7} {n:4} links, |q| < {spread:4.2f}:  " + ",  ".join(f"{name} {e:.1e}" for name, e in worst.items()))


def ldl(matrix: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """A dense solve from the tip up, as `forward_dynamics(method="dense")` writes it out, on floats."""
    a, b = matrix.copy(), rhs.copy()
    gains = np.zeros_like(a)
    for i in reversed(range(len(b))):
        gains[i, :i] = a[i, :i] / a[i, i]
        a[:i, :i] -= np.outer(gains[i, :i], a[i, :i])
        b[:i] -= gains[i, :i] * b[i]
    x = np.zeros_like(b)
    for i in range(len(b)):
        x[i] = b[i] / a[i, i] - gains[i, :i] @ x[:i]
    return x


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="?", choices=["size", "accuracy", "all"], default="all")
    parser.add_argument("--links", type=int, default=1000, help="size of the chains (default: 1000)")
    parser.add_argument("--model", choices=list(MODELS), help="of `size`: this chain alone, in this process")
    parser.add_argument("--backend", default="auto", help="of `size`: what compiles (default: auto)")
    arguments = parser.parse_args()
    if arguments.model:
        size(arguments.model, arguments.links, arguments.backend)
        return
    if arguments.what != "accuracy":
        for kind in MODELS:
            print(f"{kind} chain of {arguments.links} links", flush=True)
            options = ["--model", kind, "--links", str(arguments.links), "--backend", arguments.backend]
            subprocess.run([sys.executable, __file__, "size", *options], check=True)
    if arguments.what != "size":
        print("largest error of the accelerations, relative to the largest of them")
        for kind, n in CASES:
            for spread in (np.pi, 0.1):
                accuracy(kind, n, spread)


if __name__ == "__main__":
    main()
