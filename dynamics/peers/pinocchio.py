"""Pinocchio: rnea and aba, C++ called from Python, and its parallel loops over them on one thread."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cgraph.extend import install

from ..io.write_mjcf import moving_alone, to_mjcf
from .case import BATCH, Array, Case, rk4_step
from .contender import Contender, Peer, UnavailableError
from .mujoco import bodies


class PinocchioPeer(Peer):
    """Pinocchio on the model's MJCF.

    Damping and springs, which its algorithms leave out, are taken off the torque or added to it outside what is timed,
    except within a step of RK4.
    """

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        try:
            import pinocchio
        except ImportError as error:
            raise ImportError(f"Pinocchio is not installed: {install('bench')}") from error
        self.pinocchio = pinocchio
        mechanism = bodies(case)
        if case.nq != case.n:
            raise UnavailableError("has other coordinates of ball and free joints")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.xml"
            path.write_text(to_mjcf(moving_alone(mechanism)), encoding="utf-8")
            self.twin = pinocchio.buildModelFromMJCF(str(path))
        # Its reader of MJCF leaves gravity at the default.
        self.twin.gravity.linear = np.asarray(mechanism.gravity, dtype=np.float64)
        self.data = self.twin.createData()
        self.order = np.array([self.twin.joints[self.twin.getJointId(name)].idx_v for name in mechanism.coordinates])
        self.at = np.argsort(self.order)
        joints = [body.joint for body in mechanism.moving]
        self.stiffness = np.array([joint.stiffness for joint in joints])
        self.spring_reference = np.array([joint.spring_reference for joint in joints])
        self.damping = np.array(case.system.damping)

    def _passive(self, x: Array) -> Array:
        """The torque of dampers and springs against the motion, in our order; x: (2n or 3n,) or with columns."""
        n = self.case.n
        damping, stiffness, rest = (
            each.reshape(-1, *[1] * (x.ndim - 1)) for each in (self.damping, self.stiffness, self.spring_reference)
        )
        force: Array = damping * x[n : 2 * n] + stiffness * (x[:n] - rest)
        return force

    def _arguments(self, x: Array, task: str) -> tuple[Array, Array, Array]:
        """q, v and the third argument in Pinocchio's order."""
        n = self.case.n
        last = x[2 * n :] - self._passive(x) if task == "forward" else x[2 * n :]
        return x[self.at], x[n + self.at], last[self.at]

    def quantities(self, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
        """tau of a motion, qdd under torques tau, M(q) and the bias at one state, in our order."""
        pinocchio, twin, data, order = self.pinocchio, self.twin, self.data, self.order
        x = np.concatenate([q, qd, tau])
        upper = np.triu(pinocchio.crba(twin, data, q[self.at]))
        return {
            "tau": pinocchio.rnea(twin, data, *[each[self.at] for each in (q, qd, qdd)])[order] + self._passive(x),
            "qdd": pinocchio.aba(twin, data, *self._arguments(x, "forward"))[order],
            "M": (upper + np.triu(upper, 1).T)[np.ix_(order, order)],
            "bias": pinocchio.nonLinearEffects(twin, data, q[self.at], qd[self.at])[order],
        }

    def prepare(self, task: str, mode: str) -> Contender:
        """Pinocchio's rnea or aba, at one state or over states."""
        if task == "rk4":
            return self._step()
        x = self.case.point(task) if mode == "call" else self.case.points(task)
        added = 0.0 if task == "forward" else self._passive(x)
        arguments = self._arguments(x, task)
        if mode == "call":
            algorithm = self.pinocchio.aba if task == "forward" else self.pinocchio.rnea
            twin, data = self.twin, self.data
            return Contender(lambda: algorithm(twin, data, *arguments), lambda y: y[self.order] + added)
        return self._many("abaInParallel" if task == "forward" else "rneaInParallel", arguments, added)

    def _many(self, name: str, arguments: tuple[Array, ...], added: Any) -> Contender:
        """Its loop over the columns of a batch, on one thread. Builds without OpenMP lack it."""
        algorithm = getattr(self.pinocchio, name, None)
        if algorithm is None:
            raise UnavailableError(f"this build has no {name}")
        pool = self.pinocchio.ModelPool(self.twin, 1)
        columns = [np.asfortranarray(each) for each in arguments]
        y = np.zeros((self.case.n, BATCH), order="F")
        return Contender(
            lambda: algorithm(1, pool, *columns, y),
            lambda result: (y if result is None else result)[self.order] + added,
            BATCH,
        )

    def _step(self) -> Contender:
        """RK4 in Python over aba."""
        n, twin, data, aba = self.case.n, self.twin, self.data, self.pinocchio.aba
        damping, stiffness, rest = self.damping[self.at], self.stiffness[self.at], self.spring_reference[self.at]
        bare = not stiffness.any()

        def rate(x: Array) -> Array:
            q, v = x[:n], x[n:]
            torque = -damping * v if bare else -damping * v - stiffness * (q - rest)
            return np.concatenate([v, aba(twin, data, q, v, torque)])

        x = self.case.point("rk4")
        x = np.concatenate([x[self.at], x[n + self.at]])
        back = np.concatenate([self.order, n + self.order])
        return Contender(lambda: rk4_step(rate, x), lambda y: y[back])
