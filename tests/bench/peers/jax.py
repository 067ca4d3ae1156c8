"""JAX on the CPU: its own derivatives of the same Lagrangian, jitted, in double precision."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from tests.bench.peers.peer import DERIVATIVES, MOTIONS, NUDGE, PASSES, Peer, PeerModel, TimedTask, required, rk4_step
from tests.bench.peers.translate import lagrangian, quasi_velocities
from tests.ldl import ldl_elimination

if TYPE_CHECKING:
    from jax import Array as JaxArray

SHORT = 10  # coordinates; beyond, a solve written out takes longer to compile than it gains on LAPACK's Cholesky
NAMES = {f"a{name}": f"arc{name}" for name in ("sin", "cos", "tan")} | {"atan2": "arctan2"}


def double_precision() -> ModuleType:
    """The module, on the CPU, in float64, calls waited for. Raises ImportError naming the extra without it."""
    jax = required("jax", "JAX")
    jax.config.update("jax_platforms", "cpu")
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_cpu_enable_async_dispatch", False)  # a queue and a thread more than one core needs
    return jax


class JaxPeer(Peer):
    """JAX: `jit`, `vmap` for batches, `lax.scan` for loops."""

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        self.jax = double_precision()
        self.np = self.jax.numpy

    def _energy(self, q: JaxArray, qd: JaxArray) -> JaxArray:
        return lagrangian(self.case, q, qd, self.np, NAMES)[0]

    def _known(self, q: JaxArray, qd: JaxArray) -> JaxArray:
        forces = self.np.stack([self.np.asarray(f) for f in lagrangian(self.case, q, qd, self.np, NAMES)[1]])
        damping = self.np.array(self.case.system.damping) * qd
        slope, momenta = self.jax.grad(self._energy, 0)(q, qd), self.jax.grad(self._energy, 1)(q, qd)
        taken = quasi_velocities(self.case, q, qd, momenta, self.np, NAMES)[1]
        (pulled,) = self.jax.vjp(lambda u: self._rate(q, u), qd)[1](slope)
        return pulled + forces - damping - self.np.stack([self.np.asarray(f) for f in taken])

    def _rate(self, q: JaxArray, qd: JaxArray) -> JaxArray:
        rates = quasi_velocities(self.case, q, qd, qd, self.np, NAMES)[0]
        return self.np.stack([self.np.asarray(rate) for rate in rates])

    def _split(self, x: JaxArray) -> JaxArray:
        return self.np.split(x, [self.case.nq, self.case.nq + self.case.n])

    def _inverse(self, x: JaxArray) -> JaxArray:
        q, qd, qdd = self._split(x)
        _, rate = self.jax.jvp(self.jax.grad(self._energy, 1), (q, qd), (self._rate(q, qd), qdd))
        return rate - self._known(q, qd)

    def _forward(self, x: JaxArray) -> JaxArray:
        q, qd, tau = self._split(x)
        momentum = self.jax.grad(self._energy, 1)
        _, moved = self.jax.jvp(lambda q: momentum(q, qd), (q,), (self._rate(q, qd),))
        mass, rhs = self.jax.jacfwd(momentum, 1)(q, qd), tau + self._known(q, qd) - moved
        if self.case.n <= SHORT:
            return self.np.stack(ldl_elimination(mass, rhs)[0])
        return self.jax.scipy.linalg.solve(mass, rhs, assume_a="pos")

    def rate(self, x: JaxArray) -> JaxArray:
        """xdot of a state (q, qd) without applied torque."""
        join = self.np.concatenate
        q, qd, _ = self._split(x)
        return join([self._rate(q, qd), self._forward(join([x, self.np.zeros(self.case.n)]))])

    def _motion(self, x: JaxArray) -> JaxArray:
        join, n = self.np.concatenate, self.case.n

        def step(state: JaxArray, tau: JaxArray) -> tuple[JaxArray, None]:
            return rk4_step(lambda at: join([at[n:], self._forward(join([at, tau]))]), state), None

        return self.jax.lax.scan(step, x[: 2 * n], x[2 * n :].reshape(PASSES, n))[0]

    def _function(self, task: str) -> Callable[[JaxArray], JaxArray]:
        if task in DERIVATIVES:
            return self._slopes(self._function(DERIVATIVES[task]))
        if task in MOTIONS:
            square = self.jax.grad(lambda x: (self._motion(x)[: self.case.n] ** 2).sum())
            return self._motion if task == "motion" else square
        return {"inverse": self._inverse, "forward": self._forward, "rk4": lambda x: rk4_step(self.rate, x)}[task]

    def _slopes(self, function: Callable[[JaxArray], JaxArray]) -> Callable[[JaxArray], JaxArray]:
        """Derivatives of a function, row by row; those by q along the velocities."""

        def slopes(x: JaxArray) -> JaxArray:
            q, qd, _ = self._split(x)
            rows, along = self.jax.jacfwd(function)(x), self.jax.jacfwd(lambda u: self._rate(q, u))(qd)
            return self.np.hstack([rows[:, : self.case.nq] @ along, rows[:, self.case.nq :]]).ravel()

        return slopes

    def prepare(self, task: str, mode: str) -> TimedTask:
        jit, lax = self.jax.jit, self.jax.lax
        function, x = self._function(task), self.case.inputs(task, mode)
        if mode == "batch":
            run, x = jit(self.jax.vmap(function)), np.ascontiguousarray(x.T)
        elif mode == "loop":
            nudges = self.case.nudges(task)

            def one_pass(carry: JaxArray, _: None) -> tuple[JaxArray, None]:
                return (function(carry) if task == "rk4" else carry + NUDGE * function(carry)[nudges]), None

            run = jit(lambda x: lax.scan(one_pass, x, None, PASSES)[0])
        else:
            run = jit(function)
        there = self.np.asarray(x)
        return TimedTask(lambda: run(there).block_until_ready(), lambda y: np.asarray(y).T)
