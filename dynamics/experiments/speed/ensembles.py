"""Ensembles: run time of triple pendulums side by side, beside MuJoCo's rollout and a vmap of JAX, on one core.

All start from the same states and make the same steps of RK4, 1 s at 1 ms, in turns; the states at the end are
compared. Times are of the process's CPU, which other programs on the machine disturb less than they do the clock, per
trajectory. Peers run the first of the trajectories.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from cgraph.extend import Array

from ... import scenes
from ...io.mujoco_twin import rollout
from ...peers.jax import JaxPeer
from ...peers.mujoco import MujocoPeer
from ...peers.peer import AnyState, PeerModel, rk4_step
from ...simulation.ensembles.simulate_many import simulate_many
from ..clock import in_turns
from ..machine import load
from ..text_table import titled
from .worker import single_core

SCENE = "triple_pendulum"
STEPS, DT = 1000, 1e-3  # s
COUNT, REPEATS = 10_000, 5  # trajectories of ours, and turns
SHARE = 10  # one in so many trajectories is run by the peers
BLOCK = 250  # trajectories in a call of rollout: their states, which it records all, stay in the processor's cache
LANES = 64  # trajectories in a vmap: of 8 to 4096 the quickest number

Run = Callable[[], Array]  # states at the end, (N, 2 n)


def ours(q: Array, qd: Array) -> Run:
    """simulate_many, the states at the end alone."""
    model, t_end = scenes.load(SCENE).model, STEPS * DT

    def run() -> Array:
        result = simulate_many(model, q, qd, t_end, "rk4", dt=DT, t_eval=[t_end], estimate_error=False)
        assert result.stats.success.all()
        return np.hstack([result.q[:, -1], result.qd[:, -1]])

    return run


def mujoco(q: Array, qd: Array) -> Run:
    """MuJoCo's rollout in one thread; contacts and whatever else the pendulum does not need are off."""
    peer = MujocoPeer(PeerModel(SCENE, scenes.load(SCENE)))
    model, n = peer.twin.model, q.shape[1]
    model.opt.timestep = DT
    starts = peer.starts(np.hstack([q, qd]))
    states = np.empty((BLOCK, STEPS, 1 + 2 * n))
    blocks = [starts[k : k + BLOCK] for k in range(0, len(starts), BLOCK)]
    runs = [rollout(model, some, states[: len(some)]) for some in blocks]

    def run() -> Array:
        ends = []
        for some, each in zip(blocks, runs, strict=True):
            each()
            ends.append(states[: len(some), -1, peer.taken])
        return np.concatenate(ends)

    return run


def jax(q: Array, qd: Array) -> Run:
    """JAX's own derivatives of the same Lagrangian: jit of vmap of lax.scan, in double precision."""
    peer = JaxPeer(PeerModel(SCENE, scenes.load(SCENE)))

    def step(x: AnyState, _: None) -> tuple[AnyState, None]:
        return rk4_step(peer.rate, x, DT), None

    many = peer.jax.jit(peer.jax.vmap(lambda x: peer.jax.lax.scan(step, x, None, STEPS)[0]))
    x = np.hstack([q, qd])
    return lambda: np.concatenate([np.asarray(many(x[k : k + LANES])) for k in range(0, len(x), LANES)])


def ensembles(count: int = COUNT, repeats: int = REPEATS) -> Iterator[str]:
    """First runs as they are ready, and then the table."""
    with single_core():  # before JAX counts them
        yield from _measured(count, repeats)


def _measured(count: int, repeats: int) -> Iterator[str]:
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(-np.pi, np.pi, (count, 3)), rng.normal(size=(count, 3))
    few = max(1, count // SHARE)
    makers = {
        "simulate_many": (ours, count),
        "simulate_many, few": (ours, few),
        "MuJoCo": (mujoco, few),
        "JAX": (jax, few),
    }
    runs: dict[str, Run] = {}
    ends: dict[str, Array] = {}
    for name, (make, size) in makers.items():
        begin = time.process_time()
        try:
            run = make(q[:size], qd[:size])
        except ImportError as missing:
            yield f"{name} is not measured: {missing}"
            continue
        ends[name], runs[name] = run(), run
        yield f"first run of {name}, compiling included: {time.process_time() - begin:.3g} s of CPU"
    rows, first = [], None
    for name, taken in in_turns(runs, repeats).items():
        cpu, clock = (1e6 / len(ends[name]) * np.array([each[k] for each in taken]) for k in (1, 0))
        first = first or np.median(cpu)
        apart = np.abs(ends[name] - ends["simulate_many"][: len(ends[name])]).max(axis=1)
        cells = [np.median(cpu), min(cpu), max(cpu), np.median(clock), np.median(cpu) / first]
        differences = [f"{np.median(apart):.1e}", f"{apart.max():.1e}"]
        rows.append([name, *[f"{each:.1f}" for each in cells], *differences])
    header = [
        "us a trajectory",
        "of CPU",
        "shortest",
        "longest",
        "by the clock",
        "of ours",
        "ends differ by",
        "at most",
    ]
    yield titled(f"{count} trajectories, peers {few}; load of the machine {load()}", header, rows)
