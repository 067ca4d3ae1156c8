"""SymPy: its own derivatives of the same Lagrangian, written out by lambdify with cse; NumPy solves with M."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cgraph.extend import Array

from .case import BATCH, Case
from .contender import Contender, Peer
from .translate import lagrangian, require_rates

Values = Sequence[float | Array]
Lambdified = Callable[..., Values]
NAMES = {"abs": "Abs", "minimum": "Min", "maximum": "Max"}


class SympyPeer(Peer):
    """SymPy, as PyDy uses it: M and the right-hand side by lambdify, `numpy.linalg.solve`."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        require_rates(case)
        import sympy

        self.sympy = sympy
        self.functions: dict[str, Lambdified] = {}

    def prepare(self, task: str, mode: str) -> Contender:
        """SymPy's lambdified function of the task."""
        if task not in self.functions:
            self.functions[task] = self._lambdified(task)
        function, many = self.functions[task], mode == "batch"
        x = self.case.points(task) if many else self.case.point(task)
        return Contender(lambda: self._solved(task, function(*x), many), _array, BATCH if many else 1)

    def _lambdified(self, task: str) -> Lambdified:
        sp, n = self.sympy, self.case.n
        inputs = sp.symbols([f"{block}_{i}" for block in ("q", "qd", "last") for i in range(n)])
        q, qd, last = inputs[:n], inputs[n : 2 * n], inputs[2 * n :]
        energy, forces = lagrangian(self.case, q, qd, sp, NAMES, sp.Float)
        p = [sp.diff(energy, each) for each in qd]
        damping = self.case.system.damping
        known = [sp.diff(energy, q[i]) + forces[i] - damping[i] * qd[i] for i in range(n)]
        moved = [sum(sp.diff(p[i], q[k]) * qd[k] for k in range(n)) for i in range(n)]
        if task == "inverse":
            inertia = [sum(sp.diff(p[i], qd[k]) * last[k] for k in range(n)) for i in range(n)]
            outputs = [inertia[i] + moved[i] - known[i] for i in range(n)]
        else:
            outputs = [last[i] + known[i] - moved[i] for i in range(n)]
            outputs += [sp.diff(p[i], qd[k]) for i in range(n) for k in range(n)]
        function: Lambdified = sp.lambdify(inputs, outputs, modules="numpy", cse=True)
        return function

    def _solved(self, task: str, values: Values, many: bool) -> Values | Array:
        if task == "inverse":
            return values
        n = self.case.n
        if not many:
            return np.linalg.solve(np.array(values[n:]).reshape(n, n), np.array(values[:n]))
        columns = np.array([np.broadcast_to(value, BATCH) for value in values])  # a constant entry is one number
        mass = np.moveaxis(columns[n:].reshape(n, n, BATCH), 2, 0)
        return np.linalg.solve(mass, columns[:n].T[:, :, None])[:, :, 0].T


def _array(values: Values | Array) -> Array:
    array: Array = np.array(values)
    return array
