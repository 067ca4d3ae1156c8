"""heyoka: its own derivatives of the same Lagrangian, through LLVM; vectors of states in batches."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from cgraph.extend import install, ldl_elimination

from .case import BATCH, Case
from .contender import Contender, Peer
from .translate import lagrangian, require_rates

if TYPE_CHECKING:
    from heyoka import expression

COMPACT = 15  # coordinates; beyond, code written out takes longer to compile than its `compact_mode`


class HeyokaPeer(Peer):
    """heyoka's compiled functions. Its Taylor integrators are another way to integrate, not another RK4."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        require_rates(case)
        self.heyoka = heyoka()
        leave_cache(self.heyoka)
        self.functions: dict[str, Callable[..., object]] = {}

    def prepare(self, task: str, mode: str) -> Contender:
        """heyoka's compiled function of the task."""
        if task not in self.functions:
            outputs, inputs = expressions(self.case, task)
            self.functions[task] = self.heyoka.cfunc(outputs, inputs, compact_mode=self.case.n > COMPACT)
        function, many = self.functions[task], mode == "batch"
        x = self.case.points(task) if many else self.case.point(task)
        y = np.empty((self.case.n, *x.shape[1:]))
        return Contender(lambda: function(x, outputs=y), lambda _: y.copy(), BATCH if many else 1)


def heyoka() -> ModuleType:
    """The module. Raises ImportError naming the extra when it is not installed."""
    try:
        import heyoka as module
    except ImportError as error:
        raise ImportError(f"heyoka is not installed: {install('bench')}") from error
    found: ModuleType = module  # it has no types
    return found


def leave_cache(hy: ModuleType) -> None:
    """Let this process compile all by itself; else a second run finds on disk what the first one has compiled."""
    if hasattr(hy.llvm_state, "set_diskcache_enabled"):
        hy.llvm_state.set_diskcache_enabled(False)


def expressions(case: Case, task: str) -> tuple[list[expression], list[expression]]:
    """Outputs and inputs of inverse or forward dynamics in heyoka's expressions, by its own derivatives."""
    hy, n = heyoka(), case.n
    inputs = hy.make_vars(*[f"{block}_{i}" for block in ("q", "qd", "last") for i in range(n)])
    q, qd, last = inputs[:n], inputs[n : 2 * n], inputs[2 * n :]
    energy, forces = lagrangian(case, q, qd, hy, number=hy.expression)
    slopes = list(hy.diff_tensors([energy], diff_args=[*q, *qd], diff_order=1).gradient)
    rows = hy.diff_tensors(slopes[n:], diff_args=[*q, *qd], diff_order=1).jacobian
    damping = case.system.damping
    known = [slopes[i] + forces[i] - damping[i] * qd[i] for i in range(n)]
    moved = [hy.sum([rows[i, k] * qd[k] for k in range(n)]) for i in range(n)]
    if task == "forward":
        mass = [[rows[i, n + k] for k in range(n)] for i in range(n)]
        return ldl_elimination(mass, [last[i] + known[i] - moved[i] for i in range(n)])[0], inputs
    inertia = [hy.sum([rows[i, n + k] * last[k] for k in range(n)]) for i in range(n)]
    return [inertia[i] + moved[i] - known[i] for i in range(n)], inputs
