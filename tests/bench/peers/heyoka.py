"""heyoka: its own derivatives of the same Lagrangian, through LLVM; vectors of states in batches."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from tests.bench.peers.peer import Peer, PeerModel, TimedTask, UnavailableError, required
from tests.bench.peers.translate import lagrangian
from tests.ldl import ldl_elimination

if TYPE_CHECKING:
    from heyoka import expression

COMPACT = 15  # coordinates; beyond, code written out takes longer to compile than its `compact_mode`


class HeyokaPeer(Peer):
    """heyoka's compiled functions. Its Taylor integrators are another way to integrate, not another RK4."""

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        if case.system.kinematics.quasi is not None:
            raise UnavailableError("is measured on velocities that are rates of coordinates")
        self.heyoka = heyoka()
        if hasattr(self.heyoka.llvm_state, "set_diskcache_enabled"):
            self.heyoka.llvm_state.set_diskcache_enabled(False)  # where a second run finds what the first one compiled
        self.functions: dict[str, Callable[..., object]] = {}

    def prepare(self, task: str, mode: str) -> TimedTask:
        if task not in self.functions:
            outputs, inputs = expressions(self.case, task)
            self.functions[task] = self.heyoka.cfunc(outputs, inputs, compact_mode=self.case.n > COMPACT)
        function, x = self.functions[task], self.case.inputs(task, mode)
        y = np.empty((self.case.n, *x.shape[1:]))
        return TimedTask(lambda: function(x, outputs=y), lambda _: y.copy())


def heyoka() -> ModuleType:
    """The module. Raises ImportError naming the extra when it is not installed."""
    return required("heyoka", "heyoka")


def expressions(case: PeerModel, task: str) -> tuple[list[expression], list[expression]]:
    """Outputs and inputs of inverse or forward dynamics in heyoka's expressions, by its own derivatives."""
    hy, n = heyoka(), case.n
    inputs = hy.make_vars(*[f"{block}_{i}" for block in ("q", "qd", "last") for i in range(n)])
    q, qd, last = inputs[:n], inputs[n : 2 * n], inputs[2 * n :]
    energy, forces = lagrangian(case, q, qd, hy, number=hy.expression)
    slopes = list(hy.diff_tensors([energy], diff_args=[*q, *qd], diff_order=1).gradient)
    hessian = hy.diff_tensors(slopes[n:], diff_args=[*q, *qd], diff_order=1).jacobian
    mass = [[hessian[i, n + k] for k in range(n)] for i in range(n)]
    known = [slopes[i] + forces[i] - case.system.damping[i] * qd[i] for i in range(n)]
    rest = [hy.sum([hessian[i, k] * qd[k] for k in range(n)]) - known[i] for i in range(n)]
    if task == "forward":
        return ldl_elimination(mass, [a - b for a, b in zip(last, rest, strict=True)])[0], inputs
    inertia = [hy.sum([m * a for m, a in zip(row, last, strict=True)]) for row in mass]
    return [a + b for a, b in zip(inertia, rest, strict=True)], inputs
