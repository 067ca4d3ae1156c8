"""Ensembles to run: arms from random starts, and whether two results are the same."""

from typing import Any

import numpy as np

from dynamics import Ensemble
from tests.dynamics.models import random_arm


def arms(count: int, n: int = 2) -> tuple[Any, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(count)
    return random_arm(n), rng.uniform(-2.0, 2.0, (count, n)), rng.normal(size=(count, n))


def same(a: Ensemble, b: Ensemble) -> bool:
    """To the last bit, NaN included."""
    arrays = [(x.t, x.q, x.qd, x.stats.steps, x.stats.nfev, x.stats.rejected, x.stats.dt) for x in (a, b)]
    equal = all(np.array_equal(x, y, equal_nan=True) for x, y in zip(*arrays, strict=True))
    return equal and a.stats.message == b.stats.message
