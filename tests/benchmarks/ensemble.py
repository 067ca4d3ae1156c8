"""Run time of an ensemble of triple pendulums beside MuJoCo's rollout and a vmap of JAX, on one core of this machine.

    python tests/benchmarks/ensemble.py [--count 10000] [--peer-count 1000] [--repeats 5]

Everybody starts from the same states and makes the same steps of RK4, 1 s at 1 ms, in turns; the states at the end are
compared. Times are of the process's CPU, which other programs on the machine disturb less than they do the clock, per
trajectory, median and range. Peers run the first of the trajectories, as many as `--peer-count` says.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # so that a checkout runs without being installed

import dynamics as dyn
from dynamics.integrators.tableau import RK4
from dynamics.peers.case import Case
from dynamics.simulation.ensembles.simulate_many import simulate_many

T_END, DT = 1.0, 1e-3
STEPS = 1000
BLOCK = 250  # trajectories in a call of rollout: their states, which it records all, stay in the processor's cache
LANES = 64  # trajectories in a vmap: of 8 to 4096 the quickest number
Array = np.ndarray
Run = Callable[[], Array]  # states at the end, (N, 2 n)


def ours(q: Array, qd: Array, **options: object) -> Run:
    """simulate_many, the states at the end alone."""
    model = dyn.scenes.load("triple_pendulum").model

    def run() -> Array:
        result = simulate_many(model, q, qd, T_END, dt=DT, t_eval=[T_END], **options)
        assert result.stats.success.all()
        return np.hstack([result.q[:, -1], result.qd[:, -1]])

    return run


def mujoco(q: Array, qd: Array) -> Run:
    """MuJoCo's rollout in one thread; contacts and whatever else the pendulum does not need are off."""
    from dynamics.io.mujoco_model import rollout
    from dynamics.peers.mujoco import MujocoPeer

    peer = MujocoPeer(Case("triple_pendulum", dyn.scenes.load("triple_pendulum")))
    model, n = peer.twin.model, q.shape[1]
    model.opt.timestep = DT
    starts = np.hstack([np.zeros((len(q), 1)), q[:, peer.at], qd[:, peer.at]])  # time, qpos, qvel
    states = np.empty((BLOCK, STEPS, 1 + 2 * n))
    blocks = [starts[k : k + BLOCK] for k in range(0, len(starts), BLOCK)]
    runs = [rollout(model, some, states[: len(some)]) for some in blocks]
    taken = np.concatenate([1 + peer.order, 1 + n + peer.order])

    def run() -> Array:
        last = []
        for some, each in zip(blocks, runs, strict=True):
            each()
            last.append(states[: len(some), -1, taken])
        return np.concatenate(last)

    return run


def jax(q: Array, qd: Array) -> Run:
    """JAX's own derivatives of the same Lagrangian: jit of vmap of lax.scan, in double precision."""
    from dynamics.peers.jax import JaxPeer

    peer = JaxPeer(Case("triple_pendulum", dyn.scenes.load("triple_pendulum")))
    np_, n = peer.np, q.shape[1]

    def rate(x: object) -> object:
        return np_.concatenate([x[n:], peer._forward(np_.concatenate([x, np_.zeros(n)]))])

    def step(x: object, _: None) -> tuple[object, None]:
        slopes: list[object] = []
        for weights in (*RK4.a, RK4.b):
            at = x
            for weight, slope in zip(weights, slopes, strict=True):
                at = at + (DT * weight) * slope if weight else at
            if len(slopes) < len(RK4.b):
                slopes.append(rate(at))
        return at, None

    many = peer.jax.jit(peer.jax.vmap(lambda x: peer.jax.lax.scan(step, x, None, STEPS)[0]))
    x = np.hstack([q, qd])
    return lambda: np.concatenate([np.asarray(many(x[k : k + LANES])) for k in range(0, len(x), LANES)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000, help="trajectories of ours (default: 10000)")
    parser.add_argument("--peer-count", type=int, default=1000, help="trajectories of the peers (default: 1000)")
    parser.add_argument("--repeats", type=int, default=5, help="turns (default: 5)")
    parser.add_argument("--core", type=int, help="the core to stay on (default: the first allowed)")
    arguments = parser.parse_args()
    core = min(os.sched_getaffinity(0)) if arguments.core is None else arguments.core
    os.sched_setaffinity(0, {core})  # before JAX counts the cores
    rng = np.random.default_rng(0)
    q, qd = rng.uniform(-np.pi, np.pi, (arguments.count, 3)), rng.normal(size=(arguments.count, 3))
    few = q[: arguments.peer_count], qd[: arguments.peer_count]
    runs = {"simulate_many": (ours(q, qd), arguments.count), "simulate_many, few": (ours(*few), len(few[0]))}
    for name, make in (("mujoco", mujoco), ("jax", jax)):
        if find_spec(name):
            runs[name] = (make(*few), len(few[0]))
        else:
            print(f"{name} is not installed")
    begin, ends = time.process_time(), {}
    for name, (run, _) in runs.items():
        ends[name] = run()
        print(f"first run of {name}, compiling included: {time.process_time() - begin:.3g} s of CPU", flush=True)
        begin = time.process_time()
    cpu: dict[str, list[float]] = {name: [] for name in runs}
    clock: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(arguments.repeats):
        for name, (run, count) in runs.items():
            begin, start = time.process_time(), time.perf_counter()
            run()
            cpu[name].append((time.process_time() - begin) / count * 1e6)
            clock[name].append((time.perf_counter() - start) / count * 1e6)
    load = Path("/proc/loadavg").read_text(encoding="ascii").split()[:3] if Path("/proc/loadavg").exists() else ["?"]
    print(f"{arguments.count} trajectories, peers {len(few[0])}; core {core}; load of the machine {' '.join(load)}")
    mine = ends["simulate_many"]
    for name, times in cpu.items():
        typical, ratio = np.median(times), np.median(times) / np.median(cpu["simulate_many"])
        apart = np.abs(ends[name] - mine[: len(ends[name])]).max(axis=1)
        print(
            f"{name:20} {typical:8.1f} us of CPU a trajectory ({min(times):.1f} to {max(times):.1f}; by the clock "
            f"{np.median(clock[name]):.1f}), {ratio:6.1f} of ours; ends differ by {np.median(apart):.1e}, at most "
            f"{apart.max():.1e}"
        )


if __name__ == "__main__":
    main()
