"""Compile time: how long chains of bodies take until forward dynamics and its derivatives have a first result."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np

import cgraph as cg

from ...equations.equations_of_motion import forward_dynamics
from ...equations.linearize_many import linearize_many
from ..fresh_process import run_fresh
from ..text_table import digits, table
from .long_chains import MODELS

BODIES = (10, 30, 100)
HEADER = ["chain", "bodies", "nodes", "graph", "code", "a body", "Jacobian", "a body", "A and B", "an entry"]
TITLE = """\
Seconds of the processor from the model to a first result, every chain in a process of its own.
graph, code: forward dynamics as a graph, and compiled.  Jacobian: by q, qd and tau, of the compiled function.
A and B: `linearize_many`, 6 n^2 entries.  a body, an entry: in ms, of graph and code, the Jacobian, and A and B."""

Made = TypeVar("Made")


def compile_time(links: int | None = None) -> Iterator[str]:
    """A row a chain.  links: of this length alone."""
    rows = []
    for kind in MODELS:
        for n in BODIES if links is None else (links,):
            done = run_fresh(__name__, f"cost({kind!r}, {n})")
            if done.returncode:
                raise RuntimeError(f"{kind} chain of {n} bodies: {done.stderr.strip()[-200:]}")
            rows.append([kind, str(n), *done.stdout.split()])
    yield "\n".join([TITLE, *table(HEADER, rows, left=(0,))])


def cost(kind: str, n: int) -> None:
    """Write one chain's numbers."""
    model, seconds = MODELS[kind](n), []
    cg.compile(cg.Graph([cg.variable("x")], {"y": cg.variable("x")}))([0.0])  # LLVM is loaded

    def stage(function: Callable[[], Made]) -> Made:
        begin = time.process_time()
        result = function()
        seconds.append(time.process_time() - begin)
        return result

    graph = stage(lambda: forward_dynamics(model))
    x = np.random.default_rng(n).normal(size=len(graph.inputs))

    def called() -> cg.Compiled:
        function = cg.compile(graph)
        function(x)
        return function

    function = stage(called)
    stage(lambda: function.jacobian(x))
    stage(lambda: linearize_many(model, *[part[None] for part in np.split(x, 3)]))
    derived, compiled, jacobian, matrices = seconds
    each = 1e3 * (derived + compiled) / n, 1e3 * jacobian / n, 1e3 * matrices / (6 * n * n)
    shown = [derived, compiled, each[0], jacobian, each[1], matrices, each[2]]
    sys.stdout.write(" ".join([str(len(graph.nodes)), *[digits(value, 2) for value in shown]]))
