"""A sweep in generated Python and NumPy: the point's part over floats, the directions' part over arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices
from ..core.evaluation import Array
from ..core.graph import Graph
from .sweep import Sweep

LANES = 8


class _Function(Protocol):
    """What is used of a compiled function."""

    def values(self, x: list[float]) -> tuple[float, ...]: ...

    def batch(self, X: Array) -> Array: ...


class NumpySweep(Sweep):
    """compiled: what compiles a graph in a dialect, "python" or "numpy"."""

    def __init__(
        self,
        split: DirectionSplit,
        compiled: Callable[[Graph, str], _Function],
        guarded: DirectionSplit | None = None,
    ) -> None:
        super().__init__(split, LANES, guarded)
        self._compiled = compiled
        self._primal, self._linear = compiled(split.primal, "python"), compiled(split.linear, "numpy")

    def _like(self, split: DirectionSplit) -> NumpySweep:
        return NumpySweep(split, self._compiled)

    def _bound(self, x: Array, s: Array, y: Array, take: Indices, put: Indices, values: Array) -> Callable[[], Any]:
        def run() -> bool | None:
            directions = s.transpose(1, 0, 2).reshape(self.directions, -1)
            known = np.array(self._primal.values(x.tolist()))
            points = np.concatenate([np.repeat(known[:, None], directions.shape[1], axis=1), directions])
            y[...] = self._linear.batch(points).reshape(self.results, -1, self.lanes).transpose(1, 0, 2)
            if len(take):
                values.reshape(-1)[put] = y.reshape(-1)[take]
            return None if self._guarded is None else not np.isfinite(known).all()

        return run
