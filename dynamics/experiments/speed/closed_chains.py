"""Closed chains: forward dynamics of chains pinned at their tips, beside Pinocchio's and MuJoCo's, a call at a time."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import numpy as np

import cgraph as cg
from cgraph.extend import Array

from ...equations.equations_of_motion import forward_dynamics
from ...equations.states.consistent_state import nearest_state
from ...io.mujoco_twin import mujoco
from ...io.write_mjcf import to_mjcf
from ...multibody.builders.planar_arm import planar_arm
from ...multibody.loops import Loop
from ...multibody.trees.mechanism import Mechanism
from ...peers.peer import TimedTask
from ...peers.pinocchio import constraint_dynamics
from ..text_table import titled
from .worker import repetitions, timed

SIZES, LENGTH = (3, 10, 40), 0.8  # links, m each
PIN = (1.0, 0.0, 0.0)  # m, where the tip is held
REPEATS = 50  # turns, each short, so that some are not disturbed
PROXIMAL = 1e-12, 1e-10, 10  # Pinocchio's: what is left of the pin, its regularization, and iterations
AGREE = 1e-6  # relative: Pinocchio's iteration, which stops before rounding


def pinned(links: int) -> tuple[Mechanism, Mechanism]:
    """A chain of rods, and the same with its tip held."""
    arm = planar_arm([1.0] * links, [LENGTH] * links)
    return arm, Mechanism(arm.bodies, arm.gravity, loops=[Loop("point", "tip", to_at=PIN)])


def ours(held: Mechanism, x: Array) -> TimedTask:
    """The compiled graph, bound to its arrays: accelerations and the force of the pin."""
    compiled, n = cg.compile(forward_dynamics(held)), len(x) // 3
    out = np.empty(compiled.n_out)
    return TimedTask(compiled.bind(np.array(x), out), lambda _: out[:n])


def pinocchio(held: Mechanism, x: Array) -> TimedTask:
    """constraintDynamics, proximal, without its stabilisation."""
    run, result = constraint_dynamics(held, PROXIMAL)(x)
    return TimedTask(run, lambda _: result())


def connected(arm: Mechanism, x: Array) -> TimedTask:
    """mj_forward with an equality constraint, which is soft: other accelerations, the same work."""
    module, n = mujoco(), len(x) // 3
    hold = f'<equality><connect body1="{arm.moving[-1].name}" anchor="0 0 {-LENGTH}"/></equality>'
    model = module.MjModel.from_xml_string(to_mjcf(arm).replace("</worldbody>", f"</worldbody>{hold}"))
    data = module.MjData(model)
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = x[:n], x[n : 2 * n], x[2 * n :]
    return TimedTask(lambda: module.mj_forward(model, data), lambda _: data.qacc)


def closed_chains(repeats: int = REPEATS) -> Iterator[str]:
    """The table: nodes, microseconds a call, and ratios to ours, shortest of turns in one process."""
    rows = []
    for links in SIZES:
        arm, held = pinned(links)
        rng = np.random.default_rng(links)
        q, qd = nearest_state(held, 0.6 * rng.normal(size=links), rng.normal(size=links))
        x = np.concatenate([q, qd, rng.normal(size=links)])
        calls = {"ours": ours(held, x)}
        calls |= {"Pinocchio": pinocchio(held, x)} if find_spec("pinocchio") else {}
        calls |= {"MuJoCo": connected(arm, x)} if find_spec("mujoco") else {}
        for each in calls.values():
            each.run()
        if "Pinocchio" in calls:
            _check(links, calls["ours"], calls["Pinocchio"])
        counts = {name: repetitions(each) for name, each in calls.items()}
        turns = [{name: 1e6 * timed(each, counts[name]) for name, each in calls.items()} for _ in range(repeats)]
        spent = {name: min(turn[name] for turn in turns) for name in calls}
        ratios = [
            cell
            for name in ("Pinocchio", "MuJoCo")
            for cell in ((f"{spent[name]:.2f}", f"{spent[name] / spent['ours']:.1f}") if name in spent else ("-", "-"))
        ]
        nodes = len(forward_dynamics(held).nodes)
        rows.append([str(links), str(nodes), f"{spent['ours']:.2f}", *ratios])
    header = ["links", "nodes", "ours", "constraintDynamics", "ratio", "connect", "ratio"]
    yield titled("chains pinned at the tip; microseconds a call", header, rows)


def _check(links: int, one: TimedTask, other: TimedTask) -> None:
    """Raise ArithmeticError where accelerations differ by more than Pinocchio's iteration leaves."""
    ours, theirs = one.result(one.run()), other.result(other.run())
    off = float(np.abs(ours - theirs).max() / np.abs(ours).max())
    if not off <= AGREE:
        raise ArithmeticError(f"{links} links: accelerations differ from Pinocchio's by {off:.1e} of the largest")
