"""Explicit Runge-Kutta methods: a row of numbers each, and one step of any of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Tableau:
    """A Butcher tableau: stage s is taken at t + c_s dt and x + dt sum_j a_sj k_j; the step adds dt sum_s b_s k_s."""

    order: int
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    c: tuple[float, ...]


METHODS = {
    "euler": Tableau(1, a=((),), b=(1.0,), c=(0.0,)),
    "rk4": Tableau(4, a=((), (1 / 2,), (0, 1 / 2), (0, 0, 1)), b=(1 / 6, 1 / 3, 1 / 3, 1 / 6), c=(0, 1 / 2, 1 / 2, 1)),
}


def step(tableau: Tableau, rate: Callable[[float, Array], Array], t: float, x: Array, dt: float) -> Array:
    """The state after one step from x, (m,), at time t, where xdot = rate(t, x)."""
    slopes: list[Array] = []
    for row, c in zip(tableau.a, tableau.c, strict=True):
        at = x
        for weight, slope in zip(row, slopes, strict=True):
            if weight:
                at = at + (dt * weight) * slope
        slopes.append(rate(t + c * dt, at))
    total = tableau.b[0] * slopes[0]
    for weight, slope in zip(tableau.b[1:], slopes[1:], strict=True):
        total = total + weight * slope
    return x + dt * total
