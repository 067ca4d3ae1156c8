"""Ours beside peers where the bench has no task: differences at random states, ensembles, and closed chains."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

import cgraph as cg
from cgraph._shared import Array
from dynamics import scenes
from dynamics.equations.equations_of_motion import forward_dynamics
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.experiments.timing import Timed, in_turns, load
from dynamics.io.mujoco_module import mujoco
from dynamics.io.write_mjcf import to_mjcf
from dynamics.multibody.builders.planar_arm import planar_arm
from dynamics.multibody.loops import Loop
from dynamics.multibody.trees.mechanism import Mechanism
from dynamics.simulation.ensembles.simulate_many import simulate_many
from dynamics.verification.pinocchio_bodies import constraint_dynamics
from tests.bench.peers.jax import JaxPeer
from tests.bench.peers.mujoco import MujocoPeer, rollout
from tests.bench.peers.peer import AnyState, PeerModel, TimedTask, made, rk4_step
from tests.bench.tables import Table
from tests.bench.timing import relative_difference, repetitions, single_core, timed

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


# Closed chains: forward dynamics of chains pinned at their tips, a call at a time.
SIZES, LENGTH = (3, 10, 40), 0.8  # links, m each
PIN = (1.0, 0.0, 0.0)  # m, where the tip is held
TURNS = 50  # each short, so that some are not disturbed
PROXIMAL = 1e-12, 1e-10, 10  # Pinocchio's: what is left of the pin, its regularization, and iterations
AGREE = 1e-6  # relative: Pinocchio's iteration, which stops before rounding


def pinned(links: int) -> tuple[Mechanism, Mechanism]:
    """A chain of rods, and the same with its tip held."""
    arm = planar_arm([1.0] * links, [LENGTH] * links)
    return arm, Mechanism(arm.bodies, arm.gravity, loops=[Loop("point", "tip", to_at=PIN)])


def ours_held(held: Mechanism, x: Array) -> TimedTask:
    """The compiled graph, bound to its arrays: accelerations and the force of the pin."""
    compiled, n = cg.compile(forward_dynamics(held)), len(x) // 3
    out = np.empty(compiled.n_out)
    return TimedTask(compiled.bind(np.array(x), out), lambda _: out[:n])


def pinocchio_held(held: Mechanism, x: Array) -> TimedTask:
    """constraintDynamics, proximal, without its stabilisation."""
    run, result = constraint_dynamics(held, PROXIMAL)(x)
    return TimedTask(run, lambda _: result())


def mujoco_connected(arm: Mechanism, x: Array) -> TimedTask:
    """mj_forward with an equality constraint, which is soft: other accelerations, the same work."""
    module, n = mujoco(), len(x) // 3
    hold = f'<equality><connect body1="{arm.moving[-1].name}" anchor="0 0 {-LENGTH}"/></equality>'
    model = module.MjModel.from_xml_string(to_mjcf(arm).replace("</worldbody>", f"</worldbody>{hold}"))
    data = module.MjData(model)
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = x[:n], x[n : 2 * n], x[2 * n :]
    return TimedTask(lambda: module.mj_forward(model, data), lambda _: data.qacc)


def closed_chains(repeats: int = TURNS, sizes: tuple[int, ...] = SIZES) -> Iterator[Table | str]:
    """The table: nodes, microseconds a call, and ratios to ours, shortest of turns in one process."""
    rows: list[list[str]] = []
    absent: dict[str, str] = {}
    for links in sizes:
        arm, held = pinned(links)
        rng = np.random.default_rng(links)
        q, qd = nearest_state(held, 0.6 * rng.normal(size=links), rng.normal(size=links))
        x = np.concatenate([q, qd, rng.normal(size=links)])
        peers = {"Pinocchio": partial(pinocchio_held, held, x), "MuJoCo": partial(mujoco_connected, arm, x)}
        calls = {"ours": ours_held(held, x)} | made(peers, absent)
        results = {name: each.result(each.run()) for name, each in calls.items()}
        if "Pinocchio" in calls and not (off := relative_difference(results["Pinocchio"], results["ours"])) <= AGREE:
            raise ArithmeticError(f"{links} links: accelerations differ from Pinocchio's by {off:.1e} of the largest")
        counts = {name: repetitions(each.run) for name, each in calls.items()}
        turns = [{name: 1e6 * timed(each.run, counts[name]) for name, each in calls.items()} for _ in range(repeats)]
        least = {name: min(turn[name] for turn in turns) for name in calls}
        row = [str(links), str(len(forward_dynamics(held).nodes)), f"{least['ours']:.2f}"]
        for name in ("Pinocchio", "MuJoCo"):
            row += [f"{least[name]:.2f}", f"{least[name] / least['ours']:.1f}"] if name in least else ["-", "-"]
        rows.append(row)
    header = ["links", "nodes", "ours", "constraintDynamics", "ratio", "connect", "ratio"]
    yield Table("chains pinned at the tip; microseconds a call", header, rows)
    yield from [f"{name} is not measured: {missing}" for name, missing in absent.items()]
