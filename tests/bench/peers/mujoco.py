"""MuJoCo: mj_forward, mj_inverse, and RK4 by mj_step and rollout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cgraph._shared import Array
from dynamics.io.mujoco_module import mujoco
from dynamics.io.mujoco_twin import joint_order
from tests.bench.peers.peer import DT, PASSES, Peer, PeerModel, TimedTask, UnavailableError
from tests.mujoco_twin import AskedTwin


class MujocoPeer(Peer):
    """MuJoCo on the model's MJCF, contacts off; sensors, actuation and constraints too, as there are none."""

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        mechanism = case.bodies
        self.twin = AskedTwin(mechanism, timestep=DT)
        self.mujoco, model = self.twin.mujoco, self.twin.model
        for unused in ("CONSTRAINT", "SENSOR", "ACTUATION", "WARMSTART"):
            model.opt.disableflags |= getattr(self.mujoco.mjtDisableBit, f"mjDSBL_{unused}")
        self.q_order, self.order = (np.array(each) for each in joint_order(model, mechanism))
        self.q_at, self.at = np.argsort(self.q_order), np.argsort(self.order)
        self.taken = np.concatenate([1 + self.q_order, 1 + case.nq + self.order])  # ours among time, qpos, qvel

    def quantities(self, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
        """tau of a motion, qdd under torques tau, M(q) and the bias at one state, in our order."""
        at, twin, order, place = self.at, self.twin, self.order, q[self.q_at]
        return {
            "tau": twin.inverse(place, qd[at], qdd[at])[order],
            "qdd": twin.accelerations(place, qd[at], tau[at])[order],
            "M": twin.mass_matrix(place)[np.ix_(order, order)],
            "bias": twin.bias(place, qd[at])[order],
        }

    def starts(self, x: Array) -> Array:
        """Time, qpos and qvel, (N, 1 + nq + n), of our states, (N, nq + n), as `rollout` takes them."""
        return np.hstack([np.zeros((len(x), 1)), x[:, self.q_at], x[:, self.case.nq + self.at]])

    def prepare(self, task: str, mode: str) -> TimedTask:
        if task != "inverse" and self.twin.mechanism.loops:
            raise UnavailableError("has soft loops, which move otherwise")
        if mode != "call":
            return self._rollout(mode)
        m, model, data = self.mujoco, self.twin.model, self.twin.data
        nq, n, x = self.case.nq, self.case.n, self.case.point(task)
        data.qpos[:], data.qvel[:] = x[self.q_at], x[nq + self.at]
        if task == "forward":
            data.qfrc_applied[:] = x[nq + n + self.at]
            return TimedTask(lambda: m.mj_forward(model, data), lambda _: np.array(data.qacc[self.order]))
        if task == "inverse":
            data.qacc[:] = x[nq + n + self.at]
            return TimedTask(lambda: m.mj_inverse(model, data), lambda _: np.array(data.qfrc_inverse[self.order]))
        q, qd = data.qpos.copy(), data.qvel.copy()
        data.qfrc_applied[:] = 0.0

        def step(_: object) -> Array:  # the timed steps have gone on from the start
            data.qpos[:], data.qvel[:] = q, qd
            m.mj_step(model, data)
            return np.concatenate([data.qpos[self.q_order], data.qvel[self.order]])

        return TimedTask(lambda: m.mj_step(model, data), step)

    def _rollout(self, mode: str) -> TimedTask:
        """A thousand steps of one state, or one step of each of many, by MuJoCo's own loop in one thread."""
        starts = self.starts(np.atleast_2d(self.case.inputs("rk4", mode).T))
        states = np.empty((len(starts), PASSES if mode == "loop" else 1, starts.shape[1]))

        def result(_: object) -> Array:
            last: Array = states[:, -1, self.taken].T
            return last.copy() if mode == "batch" else last[:, 0].copy()

        return TimedTask(rollout(self.twin.model, starts, states), result)


def rollout(mj: Any, starts: Array, states: Array) -> Callable[[], None]:
    """A run of MuJoCo's own native loop of steps, one thread, from every start.

    starts: (N, 1 + 2n), the time, positions and velocities in MuJoCo's order.  states: (N, steps, 1 + 2n), which each
    run overwrites with what is after every step. The model, such as its time step, is read when it runs.
    """
    module = mujoco()
    from mujoco.rollout import rollout as native

    models, data = [mj] * len(starts), [module.MjData(mj)]  # one datum: one thread
    steps, sensors = states.shape[1], np.empty((*states.shape[:2], 0))

    def run() -> None:
        native(models, data, starts, nstep=steps, state=states, sensordata=sensors, skip_checks=True)

    return run
