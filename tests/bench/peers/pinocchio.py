"""Pinocchio: rnea and aba and their derivatives, C++ called from Python, and its parallel loops over them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cgraph._shared import Array
from dynamics.verification.pinocchio_model import PinocchioBodies, PinocchioModel, axes as axes_of

from .peer import BATCH, DERIVATIVES, Peer, PeerModel, TimedTask, UnavailableError, rk4_step


class PinocchioPeer(Peer):
    """Pinocchio on the bodies of the model.

    Damping and springs, which its algorithms leave out, are taken off the torque or added to it outside what is timed,
    except within a step of RK4, and so are states translated from our coordinates to its own.
    """

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        self.loops = case.bodies.loops
        self.bodies = PinocchioBodies(case.bodies)
        self.pinocchio, self.twin, self.data = self.bodies.pinocchio, self.bodies.model, self.bodies.data

    def quantities(self, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
        """tau of a motion, qdd under torques tau, M(q) and the bias at one state, in our order."""
        of, at = self.bodies.of, self.bodies.at
        theirs = of.q(q)
        rows = of.our_v(theirs, _symmetric(self.pinocchio.crba(self.twin, self.data, theirs)))
        still = at(np.concatenate([q, qd, np.zeros_like(qd)]), False)
        return {
            "tau": at(np.concatenate([q, qd, qdd]), False),
            "qdd": at(np.concatenate([q, qd, tau]), True),
            "M": of.our_v(theirs, rows.T),
            "bias": still - self.bodies.damping * qd,
        }

    def prepare(self, task: str, mode: str) -> TimedTask:
        if self.loops and DERIVATIVES.get(task, task) != "inverse":
            raise UnavailableError("has no loops in aba")
        if task == "rk4":
            return self._step()
        if task in DERIVATIVES:
            return self._slopes(task) if mode == "call" else self._slopes_of_batch(task)
        x, forward = self.case.inputs(task, mode), task == "forward"
        arguments = self.bodies.arguments(x, forward)

        def result(y: Array) -> Array:
            return self.bodies.result(x, *arguments[:2], y, forward)

        if mode == "call":
            algorithm = self.pinocchio.aba if forward else self.pinocchio.rnea
            twin, data = self.twin, self.data
            return TimedTask(lambda: algorithm(twin, data, *arguments), result)
        return self._many("abaInParallel" if forward else "rneaInParallel", arguments, result)

    def _many(self, name: str, arguments: tuple[Array, ...], result: Callable[[Array], Array]) -> TimedTask:
        """Pinocchio's loop over the columns of a batch, on one thread. Builds without OpenMP lack it."""
        algorithm = getattr(self.pinocchio, name, None)
        if algorithm is None:
            raise UnavailableError(f"this build has no {name}")
        pool = self.pinocchio.ModelPool(self.twin, 1)
        columns = [np.asfortranarray(each) for each in arguments]
        y = np.zeros((self.case.n, BATCH), order="F")
        return TimedTask(lambda: algorithm(1, pool, *columns, y), lambda found: result(y if found is None else found))

    def slopes(self, x: Array, task: str) -> Array:
        """The derivatives at one state, (n, 3n), with those of dampers and springs."""
        arguments = self._arguments(x, task)
        self._derivatives(task)(self.twin, self.data, *arguments)
        return self._their_slopes(task, arguments).reshape(self.case.n, 3 * self.case.n)

    def _arguments(self, x: Array, task: str) -> tuple[Array, Array, Array]:
        return self.bodies.arguments(x, task == "derivatives")

    def _slopes(self, task: str) -> TimedTask:
        """The derivatives of rnea or aba; those of dampers and springs are added outside what is timed."""
        arguments, algorithm = self._arguments(self.case.point(task), task), self._derivatives(task)
        model, data = self.twin, self.data
        return TimedTask(lambda: algorithm(model, data, *arguments), lambda _: self._their_slopes(task, arguments))

    def _slopes_of_batch(self, task: str) -> TimedTask:
        """A call for every state; what it leaves in Pinocchio's memory is read outside what is timed."""
        states = [self._arguments(x, task) for x in self.case.points(task).T]
        algorithm = self._derivatives(task)
        model, data = self.twin, self.data

        def run() -> None:
            for q, v, last in states:
                algorithm(model, data, q, v, last)

        def result(_: None) -> Array:
            rows = []
            for arguments in states:
                algorithm(model, data, *arguments)
                rows.append(self._their_slopes(task, arguments))
            return np.array(rows).T

        return TimedTask(run, result)

    def _derivatives(self, task: str) -> Callable[..., object]:
        """Pinocchio's function. Raises UnavailableError for a model that has more than it knows."""
        stretched = self.bodies.stiffness != 0.0
        if any([stretched[place.u].any() for place in self.bodies.balls]):
            raise UnavailableError("has no slopes of the springs of ball joints")
        derivatives: Callable[..., object] = getattr(
            self.pinocchio, f"compute{'ABA' if task == 'derivatives' else 'RNEA'}Derivatives"
        )
        return derivatives

    def _their_slopes(self, task: str, arguments: tuple[Array, Array, Array]) -> Array:
        forward, n, data = task == "derivatives", self.case.n, self.data
        if forward:
            found = data.ddq_dq, data.ddq_dv, _symmetric(data.Minv)
        else:
            found = data.dtau_dq, data.dtau_dv, _symmetric(data.M)
        rows = our_slopes(self.bodies.of, *arguments, data.ddq if forward else data.tau, found, forward=forward)
        by_q, by_u, by_last = (rows[:, k * n : (k + 1) * n] for k in range(3))
        passive = -by_last if forward else np.eye(n)
        stiffness, damping = self.bodies.stiffness, self.bodies.damping
        return np.hstack([by_q + passive * stiffness, by_u + passive * damping, by_last]).ravel()

    def _step(self) -> TimedTask:
        if self.case.nq != self.case.n:
            raise UnavailableError("has no rates of quaternions")
        n, twin, data, aba, bodies = self.case.n, self.twin, self.data, self.pinocchio.aba, self.bodies
        at, back = np.argsort(bodies.of.order), np.concatenate([bodies.of.order, n + bodies.of.order])
        damping, stiffness, rest = bodies.damping[at], bodies.stiffness[at], bodies.spring_reference[at]
        bare = not stiffness.any()

        def rate(x: Array) -> Array:
            q, v = x[:n], x[n:]
            torque = -damping * v if bare else -damping * v - stiffness * (q - rest)
            return np.concatenate([v, aba(twin, data, q, v, torque)])

        x = self.case.point("rk4")
        x = np.concatenate([x[at], x[n + at]])
        return TimedTask(lambda: rk4_step(rate, x), lambda y: y[back])


def _symmetric(upper: Array) -> Array:
    rows = np.triu(upper)
    return rows + np.triu(rows, 1).T


def our_slopes(
    of: PinocchioModel, q: Array, v: Array, last: Array, y: Array, slopes: tuple[Array, Array, Array], *, forward: bool
) -> Array:
    """Our derivatives by q, qd and the last argument, (n, 3 n), of Pinocchio's result y at q, v, last and its own.

    Of free bodies, with E = diag(R^T, 1) and dtheta the turn: last = E ours - into(v), ours = E^T (y + out(v)),
    dv = E du + [v]x dtheta, dlast = E dours + [E ours]x dtheta - dinto dv; displacements E xi.
    forward: y is an acceleration and `last` a force, else the other way around.
    """
    n = len(v)
    into, out = (of.rotor, of.curved) if forward else (of.curved, of.rotor)
    axes, turned_v, turned_last, turned_y, slope_in, slope_out = np.eye(n), *(np.zeros((n, n)) for _ in range(5))
    raw, whole = last + into(v), y + out(v)
    for linear, angular, rows, armature in of.turned:
        axes[linear, linear] = axes_of(q[rows]).T
        for matrix, vector in ((turned_v, v[linear]), (turned_last, raw[linear]), (turned_y, -whole[linear])):
            matrix[linear, angular] = _cross(vector)
        for matrix, scale in zip((slope_in, slope_out), (armature, 1.0) if forward else (1.0, armature), strict=True):
            matrix[linear, linear] = scale * _cross(v[angular])
            matrix[linear, angular] = -scale * _cross(v[linear])
    by_q, by_v, by_last = slopes
    by_v = by_v - by_last @ slope_in + slope_out
    by_q = by_q @ axes + by_v @ turned_v + by_last @ turned_last + turned_y
    ours = [(axes.T @ matrix)[np.ix_(of.order, of.order)] for matrix in (by_q, by_v @ axes, by_last @ axes)]
    return np.hstack(ours)


def _cross(vector: Array) -> Array:
    return np.cross(np.eye(3), vector)
