"""SymPy: its own derivatives of the same Lagrangian, written out by lambdify with cse; NumPy solves with M."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cgraph._shared import Array
from tests.bench.peers.peer import BATCH, Peer, PeerModel, TimedTask, required
from tests.bench.peers.translate import lagrange, lagrangian, require_rates

Values = Sequence[float | Array]
Lambdified = Callable[..., Values]
NAMES = {"abs": "Abs", "minimum": "Min", "maximum": "Max"}


class SympyPeer(Peer):
    """SymPy, as PyDy uses it: M and the right-hand side by lambdify, `numpy.linalg.solve`."""

    def __init__(self, case: PeerModel) -> None:
        super().__init__(case)
        require_rates(case)
        self.sympy = required("sympy", "SymPy")
        self.functions: dict[str, Lambdified] = {}

    def prepare(self, task: str, mode: str) -> TimedTask:
        if task not in self.functions:
            self.functions[task] = self._lambdified(task)
        function, many = self.functions[task], mode == "batch"
        x = self.case.inputs(task, mode)
        return TimedTask(lambda: self._solved(task, function(*x), many), np.array)

    def _lambdified(self, task: str) -> Lambdified:
        sp, n = self.sympy, self.case.n
        inputs = sp.symbols([f"{block}_{i}" for block in ("q", "qd", "last") for i in range(n)])
        q, qd, last = inputs[:n], inputs[n : 2 * n], inputs[2 * n :]
        energy, forces = lagrangian(self.case, q, qd, sp, NAMES, sp.Float)
        slopes = [sp.diff(energy, each) for each in (*q, *qd)]
        hessian = {(i, k): sp.diff(p, x) for i, p in enumerate(slopes[n:]) for k, x in enumerate((*q, *qd))}
        mass, rest = lagrange(self.case, qd, slopes, hessian, forces, sum)
        if task == "inverse":
            outputs = [
                sum([m * a for m, a in zip(row, last, strict=True)]) + b for row, b in zip(mass, rest, strict=True)
            ]
        else:
            outputs = [a - b for a, b in zip(last, rest, strict=True)] + [entry for row in mass for entry in row]
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
