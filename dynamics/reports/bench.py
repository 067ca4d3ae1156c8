"""The bench: forward dynamics of a few models by our compiled graph and by its peers, in turns in one run."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import cgraph as cg

from ..equations import forward_dynamics
from ..mechanism import WORLD, Body, Joint, Mechanism
from ..planar_arm import planar_arm
from ..spatial import rotation
from ..system import as_system
from .peers import Model, peers

BATCH = 4096  # states
CHUNK = 2e-3  # s, at least, of calls that are timed together


@dataclass(frozen=True)
class Row:
    """One model. Times are medians of alternating repetitions, in microseconds."""

    model: str
    nodes: int
    build: float  # s, Lagrangian to simplified graph
    compile: float  # s, graph to the first result
    backend: str
    ours: float  # us a call
    batch: float  # us a state, in a batch of 4096
    peers: dict[str, float] = field(default_factory=dict)  # us a call
    difference: dict[str, float] = field(default_factory=dict)  # largest, relative to the largest entry


def turned_arm(n: int) -> Mechanism:
    """A 3D arm of n revolute joints, full inertias, frames turned by quarter turns."""
    rng = np.random.default_rng(n)
    return Mechanism([_body(i, WORLD if i == 0 else f"link{i}", rng) for i in range(n)])


def binary_tree(n: int) -> Mechanism:
    """A tree of n revolute bodies, each with two children until there are n."""
    rng = np.random.default_rng(n)
    return Mechanism([_body(i, WORLD if i == 0 else f"link{(i - 1) // 2 + 1}", rng) for i in range(n)])


def _body(i: int, parent: str, rng: np.random.Generator) -> Body:
    mixed = rng.normal(size=(3, 3))
    second = 0.05 * mixed @ mixed.T + 0.01 * np.eye(3)  # of mass; any such matrix is a body's
    turn = rotation(np.array([1.0, 0.0, 0.0]), (0.0, math.pi / 2, -math.pi / 2)[i % 3])
    return Body(
        f"link{i + 1}",
        Joint("revolute", position=(0.1, 0.0, 0.3) if i else (0.0, 0.0, 0.0), orientation=turn, damping=0.1),
        parent,
        mass=float(rng.uniform(1.0, 2.0)),
        center=0.1 * rng.normal(size=3),
        inertia=np.trace(second) * np.eye(3) - second,
    )


MODELS: dict[str, Callable[[], Model]] = {
    "planar 3": lambda: planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], damping=0.1),
    "planar 7": lambda: planar_arm([0.5] * 7, [0.5] * 7, damping=0.1),
    "planar 20": lambda: planar_arm([0.2] * 20, [0.2] * 20, damping=0.1),
    "planar 50": lambda: planar_arm([0.1] * 50, [0.1] * 50, damping=0.1),
    "arm 7": lambda: turned_arm(7),
    "arm 30": lambda: turned_arm(30),
    "tree 15": lambda: binary_tree(15),
}


def bench(name: str, repeats: int = 15) -> Row:
    """One row, for a name among `MODELS`."""
    model = MODELS[name]()
    system = as_system(model)
    start = time.perf_counter()
    graph = forward_dynamics(model)
    built = time.perf_counter() - start
    x = np.random.default_rng(0).normal(size=len(graph.inputs))
    start = time.perf_counter()
    function = cg.compile(graph)
    expected = function(x)
    compiled = time.perf_counter() - start
    contenders: dict[str, Callable[[Any], Any]] = {"ours": function} | peers(model, system)
    difference = {
        peer: float(np.abs(contenders[peer](x) - expected).max() / np.abs(expected).max())
        for peer in contenders
        if peer != "ours"
    }
    times = _alternating(contenders, x, repeats)
    states = np.random.default_rng(1).normal(size=(len(x), BATCH))
    function.batch(states)
    batch = []
    for _ in range(repeats):
        start = time.perf_counter()
        function.batch(states)
        batch.append((time.perf_counter() - start) / BATCH)
    return Row(
        name,
        len(graph.nodes),
        built,
        compiled,
        function.backend,
        times.pop("ours"),
        1e6 * statistics.median(batch),
        times,
        difference,
    )


def _alternating(contenders: dict[str, Callable[[Any], Any]], x: np.ndarray, repeats: int) -> dict[str, float]:
    """Median time of a call [us] of each, the contenders taking turns so that they share the machine's moods."""
    loops = {}
    for name, function in contenders.items():
        start = time.perf_counter()
        function(x)
        loops[name] = max(5, math.ceil(CHUNK / (time.perf_counter() - start)))
    samples: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(repeats):
        for name, function in contenders.items():
            start = time.perf_counter()
            for _ in range(loops[name]):
                function(x)
            samples[name].append((time.perf_counter() - start) / loops[name])
    return {name: 1e6 * statistics.median(values) for name, values in samples.items()}
