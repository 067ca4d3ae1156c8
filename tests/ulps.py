"""Distances between numbers in units of the last place, and values by mpmath to measure them from."""

from functools import cache
from typing import Any, NamedTuple

import mpmath
import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]
DIGITS = 60


class Exact(NamedTuple):
    """Numbers as sums of two doubles, high the nearest one: 32 digits."""

    high: Array
    low: Array

    def error_of(self, found: Any) -> float:
        """The largest error in ulps; infinite for a NaN."""
        with np.errstate(all="ignore"):
            error = np.abs((np.asarray(found) - self.high) - self.low) / np.spacing(np.abs(self.high))
        return float(np.max(np.where(np.isnan(error), np.inf, error), initial=0.0))


def exact(name: str, points: Array) -> Exact:
    """mpmath's function at points that are finite and in its domain."""
    return _exact(name, points.tobytes())


@cache
def _exact(name: str, points: bytes) -> Exact:
    high, low = [], []
    with mpmath.workdps(DIGITS):
        for x in np.frombuffer(points).tolist():
            true = getattr(mpmath, name)(mpmath.mpf(x))
            high.append(float(true))
            low.append(float(true - high[-1]))
    return Exact(np.array(high), np.array(low))


def ulps_apart(found: Any, expected: Any) -> float:
    """The largest distance from `expected`; 0 between two NaN, infinite between numbers of different kinds."""
    found, expected = np.asarray(found, float).ravel(), np.asarray(expected, float).ravel()
    equal = (found == expected) | (np.isnan(found) & np.isnan(expected))
    with np.errstate(all="ignore"):
        distance = np.where(equal, 0.0, np.abs(found - expected) / np.spacing(np.abs(expected)))
    return float(np.max(np.where(np.isnan(distance), np.inf, distance), initial=0.0))


def same(found: Any, expected: Any) -> bool:
    """Whether all are equal to the last bit and in the sign of a zero; any NaN equals another."""
    found, expected = np.asarray(found), np.asarray(expected)
    nan = np.isnan(expected)
    return np.array_equal(np.isnan(found), nan) and np.array_equal(
        found[~nan].view(np.int64), expected[~nan].view(np.int64)
    )
