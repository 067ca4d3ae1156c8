"""A sweep in generated Python and NumPy: the point's part over floats, the directions' part over arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from ..autodiff.direction_split import DirectionSplit
from ..autodiff.sparsity import Indices
from ..core.evaluate import Array
from .sweep import NO_ENTRIES, Sweep

LANES = 8


class _Function(Protocol):
    """What is used of a compiled function."""

    def values(self, x: list[float]) -> tuple[float, ...]: ...

    def batch(self, X: Array) -> Array: ...


class NumpySweep(Sweep):
    """primal, linear: the two parts of the split, compiled."""

    def __init__(self, split: DirectionSplit, primal: _Function, linear: _Function) -> None:
        super().__init__(split, LANES)
        self._primal, self._linear = primal, linear

    def bind(
        self, x: Array, s: Array, y: Array, take: Indices = NO_ENTRIES, put: Indices = NO_ENTRIES, values: Any = None
    ) -> Callable[[], None]:
        """As `Sweep.bind` says."""

        def run() -> None:
            directions = s.transpose(1, 0, 2).reshape(self.directions, -1)
            known = np.array(self._primal.values(x.tolist()))
            points = np.concatenate([np.repeat(known[:, None], directions.shape[1], axis=1), directions])
            y[...] = self._linear.batch(points).reshape(self.results, -1, self.lanes).transpose(1, 0, 2)
            if len(take):
                values.reshape(-1)[put] = y.reshape(-1)[take]

        return run
