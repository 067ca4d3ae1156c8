"""Ensembles: many triple pendulums beside MuJoCo's rollout and JAX's vmap."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from cgraph._shared import Array
from dynamics import scenes
from dynamics.experiments.timing import Timed, in_turns, load
from dynamics.simulation.ensembles.simulate_many import simulate_many
from tests.bench.peers.jax import JaxPeer
from tests.bench.peers.mujoco import MujocoPeer, rollout
from tests.bench.peers.peer import AnyState, PeerModel, made, rk4_step
from tests.bench.tables import Table
from tests.bench.timing import single_core

# Ensembles: triple pendulums from the same states make the same steps of RK4, 1 s at 1 ms, on one core; times are of
# the process's CPU, which other programs on the machine disturb less than they do the clock, per trajectory.
SCENE = "triple_pendulum"
STEPS, DT = 1000, 1e-3  # s
COUNT, REPEATS = 10_000, 5  # trajectories of ours, and turns
SHARE = 10  # one in so many trajectories is run by the peers
BLOCK = 250  # trajectories in a call of rollout: their states, which it records all, stay in the processor's cache
LANES = 64  # trajectories in a vmap: of 8 to 4096 the quickest number

Run = Callable[[], Array]  # states at the end, (N, 2 n)


def ours_side_by_side(q: Array, qd: Array) -> Run:
    """simulate_many, the states at the end alone."""
    model, t_end = scenes.load(SCENE).model, STEPS * DT

    def run() -> Array:
        result = simulate_many(model, q, qd, t_end, "rk4", dt=DT, t_eval=[t_end], estimate_error=False)
        assert result.stats.success.all()
        return np.hstack([result.q[:, -1], result.qd[:, -1]])

    return run


def mujoco_side_by_side(q: Array, qd: Array) -> Run:
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


def jax_side_by_side(q: Array, qd: Array) -> Run:
    """JAX's own derivatives of the same Lagrangian: jit of vmap of lax.scan, in double precision."""
    peer = JaxPeer(PeerModel(SCENE, scenes.load(SCENE)))

    def step(x: AnyState, _: None) -> tuple[AnyState, None]:
        return rk4_step(peer.rate, x, DT), None

    many = peer.jax.jit(peer.jax.vmap(lambda x: peer.jax.lax.scan(step, x, None, STEPS)[0]))
    x = np.hstack([q, qd])
    return lambda: np.concatenate([np.asarray(many(x[k : k + LANES])) for k in range(0, len(x), LANES)])


SIDE_BY_SIDE = {  # the first runs all trajectories, the others few
    "simulate_many": ours_side_by_side,
    "simulate_many, few": ours_side_by_side,
    "MuJoCo": mujoco_side_by_side,
    "JAX": jax_side_by_side,
}


def ensembles(count: int = COUNT, repeats: int = REPEATS) -> Iterator[Table | str]:
    """First runs as they are ready, and then the table."""
    with single_core():  # before JAX counts them
        yield from _ensembles(count, repeats)


def _ensembles(count: int, repeats: int) -> Iterator[Table | str]:
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(-np.pi, np.pi, (count, 3)), rng.normal(size=(count, 3))
    few = max(1, count // SHARE)
    runs: dict[str, Timed] = {}
    ends: dict[str, Array] = {}
    for name, make in SIDE_BY_SIDE.items():
        begin, size = time.process_time(), few if runs else count
        absent: dict[str, str] = {}
        for run in made({name: partial(make, q[:size], qd[:size])}, absent).values():
            ends[name], runs[name] = run(), Timed(run)
            yield f"first run of {name}, compiling included: {time.process_time() - begin:.3g} s of CPU"
        yield from [f"{name} is not measured: {missing}" for missing in absent.values()]
    in_turns([*runs.values()], repeats)
    rows, first = [], None
    for name, each in runs.items():
        cpu, clock = (1e6 / len(ends[name]) * np.array(taken) for taken in (each.processor, each.seconds))
        first = first or np.median(cpu)
        apart = np.abs(ends[name] - ends["simulate_many"][: len(ends[name])]).max(axis=1)
        cells = [np.median(cpu), min(cpu), max(cpu), np.median(clock), np.median(cpu) / first]
        rows.append([name, *[f"{cell:.1f}" for cell in cells], f"{np.median(apart):.1e}", f"{apart.max():.1e}"])
    header = ["of CPU", "shortest", "longest", "by the clock", "of ours", "ends differ by", "at most"]
    title = f"{count} trajectories, peers {few}; load of the machine {load()}"
    yield Table(title, ["us a trajectory", *header], rows)
