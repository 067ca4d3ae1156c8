"""Pinocchio: rnea and aba, C++ called from Python, its parallel loops over them, and constraintDynamics of loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..multibody.bodies.body import WORLD
from ..multibody.bodies.joint_coordinates import per_velocity, places
from ..multibody.loops import Loop
from ..multibody.trees.mechanism import Mechanism
from .peer import BATCH, DERIVATIVES, Peer, PeerModel, TimedTask, UnavailableError, rk4_step
from .pinocchio_model import PinocchioModel, pinocchio

if TYPE_CHECKING:
    from pinocchio import SE3


class PinocchioPeer(Peer):
    """Pinocchio on the bodies of the model.

    Damping and springs, which its algorithms leave out, are taken off the torque or added to it outside what is timed,
    except within a step of RK4, and so are states translated from our coordinates to its own.
    """

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        self.pinocchio = pinocchio()
        mechanism = case.bodies
        self.loops = mechanism.loops
        self.of = PinocchioModel(mechanism)
        self.twin = self.of.model
        self.data = self.twin.createData()
        moving = mechanism.moving
        self.stiffness = np.array(per_velocity(moving, [body.joint.stiffness for body in moving]))
        self.spring_reference = np.array(per_velocity(moving, [body.joint.spring_reference for body in moving]))
        self.damping = np.array(case.system.damping)
        self.balls = [place for body, place in zip(moving, places(moving), strict=True) if body.joint.kind == "ball"]
        # Where the coordinate of a velocity is; of joints with several, the first.
        self.coordinate = np.array(per_velocity(moving, [place.q.start for place in places(moving)]))

    def _passive(self, q: Array, u: Array) -> Array:
        """The torque of dampers and springs against the motion, in our order; (n,), or with columns."""
        damping, stiffness, rest = (
            each.reshape(-1, *[1] * (u.ndim - 1)) for each in (self.damping, self.stiffness, self.spring_reference)
        )
        stretch = q[self.coordinate] - rest
        for place in self.balls:
            stretch[place.u] = _rotation_vector(q[place.q])
        force: Array = damping * u + stiffness * stretch
        return force

    def arguments(self, x: Array, task: str) -> tuple[Array, Array, Array]:
        """q, v and the third argument as Pinocchio has them."""
        q, u, last = np.split(x, [self.case.nq, self.case.nq + self.case.n])
        theirs = self.of.q(q)
        v = self.of.v(theirs, u)
        if task == "inverse":
            return theirs, v, self.of.a(theirs, v, last)
        return theirs, v, self.of.v(theirs, last - self._passive(q, u)) - self.of.rotor(v)

    def _result(self, x: Array, q: Array, v: Array, y: Array, task: str) -> Array:
        """Torques of the motion or accelerations as we have them.  q, v: Pinocchio's."""
        if task == "forward":
            return self.of.our_a(q, v, y)
        nq = self.case.nq
        return self.of.our_v(q, y + self.of.rotor(v)) + self._passive(x[:nq], x[nq : nq + self.case.n])

    def _asked(self, x: Array, task: str) -> Array:
        """The answer at one state."""
        algorithm = self.pinocchio.aba if task == "forward" else self.pinocchio.rnea
        q, v, last = self.arguments(x, task)
        return self._result(x, q, v, algorithm(self.twin, self.data, q, v, last), task)

    def quantities(self, q: Array, qd: Array, qdd: Array, tau: Array) -> dict[str, Array]:
        """tau of a motion, qdd under torques tau, M(q) and the bias at one state, in our order."""
        theirs = self.of.q(q)
        upper = np.triu(self.pinocchio.crba(self.twin, self.data, theirs))
        rows = self.of.our_v(theirs, upper + np.triu(upper, 1).T)
        still = self._asked(np.concatenate([q, qd, np.zeros_like(qd)]), "inverse")
        return {
            "tau": self._asked(np.concatenate([q, qd, qdd]), "inverse"),
            "qdd": self._asked(np.concatenate([q, qd, tau]), "forward"),
            "M": self.of.our_v(theirs, rows.T),
            "bias": still - self.damping * qd,
        }

    def prepare(self, task: str, mode: str) -> TimedTask:
        """Pinocchio's rnea or aba, at one state or over states."""
        if self.loops and DERIVATIVES.get(task, task) != "inverse":
            raise UnavailableError("has no loops in aba; `cgraph bench closed-chains` has its constraintDynamics")
        if task == "rk4":
            return self._step()
        if task in DERIVATIVES:
            return self._slopes(task) if mode == "call" else self._slopes_of_batch(task)
        x = self.case.inputs(task, mode)
        arguments = self.arguments(x, task)

        def result(y: Array) -> Array:
            return self._result(x, *arguments[:2], y, task)

        if mode == "call":
            algorithm = self.pinocchio.aba if task == "forward" else self.pinocchio.rnea
            twin, data = self.twin, self.data
            return TimedTask(lambda: algorithm(twin, data, *arguments), result)
        return self._many("abaInParallel" if task == "forward" else "rneaInParallel", arguments, result)

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
        arguments = self.arguments(x, DERIVATIVES[task])
        self._derivatives(task)(self.twin, self.data, *arguments)
        return self._their_slopes(task, arguments).reshape(self.case.n, 3 * self.case.n)

    def _slopes(self, task: str) -> TimedTask:
        """The derivatives of rnea or aba; those of dampers and springs are added outside what is timed."""
        arguments = self.arguments(self.case.point(task), DERIVATIVES[task])
        algorithm = self._derivatives(task)
        model, data = self.twin, self.data
        return TimedTask(lambda: algorithm(model, data, *arguments), lambda _: self._their_slopes(task, arguments))

    def _slopes_of_batch(self, task: str) -> TimedTask:
        """A call for every state; what it leaves in Pinocchio's memory is read outside what is timed."""
        states = [self.arguments(x, DERIVATIVES[task]) for x in self.case.points(task).T]
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
        stretched = self.stiffness != 0.0
        if any([stretched[place.u].any() for place in self.balls]):
            raise UnavailableError("has no slopes of the springs of ball joints")
        derivatives: Callable[..., object] = getattr(
            self.pinocchio, f"compute{'ABA' if task == 'derivatives' else 'RNEA'}Derivatives"
        )
        return derivatives

    def _their_slopes(self, task: str, arguments: tuple[Array, Array, Array]) -> Array:
        """Derivatives that the last call has left, in our order."""
        forward, n, data = task == "derivatives", self.case.n, self.data
        if forward:
            found = data.ddq_dq, data.ddq_dv, _symmetric(data.Minv)
        else:
            found = data.dtau_dq, data.dtau_dv, _symmetric(data.M)
        rows = self.of.our_slopes(*arguments, data.ddq if forward else data.tau, found, forward=forward)
        by_q, by_u, by_last = (rows[:, k * n : (k + 1) * n] for k in range(3))
        passive = -by_last if forward else np.eye(n)
        return np.hstack([by_q + passive * self.stiffness, by_u + passive * self.damping, by_last]).ravel()

    def _step(self) -> TimedTask:
        """RK4 in Python over aba."""
        if self.case.nq != self.case.n:
            raise UnavailableError("has no rates of quaternions")
        n, twin, data, aba = self.case.n, self.twin, self.data, self.pinocchio.aba
        at, back = np.argsort(self.of.order), np.concatenate([self.of.order, n + self.of.order])
        damping, stiffness, rest = self.damping[at], self.stiffness[at], self.spring_reference[at]
        bare = not stiffness.any()

        def rate(x: Array) -> Array:
            q, v = x[:n], x[n:]
            torque = -damping * v if bare else -damping * v - stiffness * (q - rest)
            return np.concatenate([v, aba(twin, data, q, v, torque)])

        x = self.case.point("rk4")
        x = np.concatenate([x[at], x[n + at]])
        return TimedTask(lambda: rk4_step(rate, x), lambda y: y[back])


def _symmetric(upper: Array) -> Array:
    """The matrix whose upper triangle is there."""
    rows = np.triu(upper)
    return rows + np.triu(rows, 1).T


def _rotation_vector(e: Array) -> Array:
    """Axis times angle [rad], at most pi, of quaternions (w, x, y, z), (4,) or (4, k)."""
    length = np.linalg.norm(e[1:], axis=0)
    angle = 2.0 * np.arctan2(length, np.abs(e[0]))
    result: Array = e[1:] * (np.copysign(angle, e[0]) / np.where(length, length, 1.0))
    return result


_KINDS = {"point": "CONTACT_3D", "weld": "CONTACT_6D"}
_PROXIMAL = 1e-14, 1e-8, 200  # what is left of the constraints, its regularization, and iterations


def constrained_accelerations(mechanism: Mechanism, q: Array, qd: Array, tau: Array) -> Array:
    """qdd, (N, n), at states that meet the loops, without Baumgarte's stabilization.

    Raises ImportError without Pinocchio, and UnavailableError for what it has not.
    """
    ready, rows = constraint_dynamics(mechanism, _PROXIMAL), []
    for x in np.concatenate([q, qd, tau], axis=1):
        run, result = ready(x)
        run()
        rows.append(result())
    return np.array(rows)


def constraint_dynamics(
    mechanism: Mechanism, proximal: tuple[float, float, int]
) -> Callable[[Array], tuple[Callable[[], object], Callable[[], Array]]]:
    """Call at x = (q, qd, tau), and a function that reads the accelerations, (n,), that it left.

    proximal: what is left of the constraints, its regularization, and iterations. Raises as above.
    """
    for loop in mechanism.loops:
        if loop.kind not in _KINDS:
            raise UnavailableError(f"has no loop of the kind {loop.kind!r}")
    peer = PinocchioPeer(PeerModel("held", mechanism))
    pin, twin, data = peer.pinocchio, peer.twin, peer.data
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for loop in mechanism.loops:
        ends = [*_frame(peer, mechanism, loop.body, loop.at), *_frame(peer, mechanism, loop.to, loop.to_at, loop)]
        models.append(pin.RigidConstraintModel(getattr(pin.ContactType, _KINDS[loop.kind]), twin, *ends, pin.LOCAL))
        datas.append(models[-1].createData())
    pin.initConstraintDynamics(twin, data, models, datas)
    settings, solve = pin.ProximalSettings(*proximal), pin.constraintDynamics

    def ready(x: Array) -> tuple[Callable[[], object], Callable[[], Array]]:
        theirs = peer.arguments(x, "forward")
        return (
            lambda: solve(twin, data, *theirs, models, datas, settings),
            lambda: peer.of.our_a(*theirs[:2], np.array(data.ddq)),
        )

    return ready


def _frame(
    peer: PinocchioPeer, mechanism: Mechanism, body: str, at: ArrayLike, loop: Loop | None = None
) -> tuple[int, SE3]:
    """Pinocchio's joint of a body, and the frame of a loop there.  loop: whose orientation the frame has."""
    carrier = mechanism.carriers[body]
    names = {each.name: each.coordinate for each in mechanism.moving}
    joint = 0 if carrier.name == WORLD else peer.twin.getJointId(names[carrier.name])
    turn = np.eye(3) if loop is None else np.asarray(loop.orientation, dtype=np.float64)
    place = carrier.position + carrier.orientation @ np.asarray(at, dtype=np.float64)
    return joint, peer.pinocchio.SE3(carrier.orientation @ turn, place)
