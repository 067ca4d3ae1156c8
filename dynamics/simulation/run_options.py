"""Limits: what a run is held to, its end, its steps and its errors, checked in one place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import real_array, real_number

from .trajectory import Array


@dataclass(frozen=True)
class Limits:
    """Of a run that chooses its steps so that each one's error stays within rtol |x| + atol."""

    t_end: float = 1.0  # s
    rtol: float = 1e-8
    atol: float | Array = 1e-10  # (m,), or one number for all
    longest: float = math.inf  # step, s
    first: float | None = None  # step, s; None: chosen
    most: float = math.inf  # steps, after which it stops


def step_count(length: float, dt: float) -> int:
    """The fewest equal steps of at most dt; a dt too short by rounding is long enough."""
    return max(1, math.ceil(length / dt * (1.0 - 1e-12)))


def limits_of(
    states: Sequence[str],
    t_end: float,
    dt: float | None,
    first_step: float | None,
    rtol: float,
    atol: ArrayLike,
    max_steps: float,
) -> Limits:
    """The limits that a caller gave.

    Raises TypeError or ValueError, naming the argument, unless times [s] are positive and finite and tolerances make
    sense.
    """
    for what, value in (("t_end", t_end), ("dt", dt), ("first_step", first_step)):
        if value is not None and not (math.isfinite(real_number(what, value)) and value > 0.0):
            raise ValueError(f"{what} must be positive and finite, got {value!r} s")
    rtol, absolute = real_number("rtol", rtol), real_array("atol", atol)
    if absolute.ndim and absolute.shape != (len(states),):
        raise ValueError(
            f"atol must be one number, or have shape ({len(states)},), one for each of {', '.join(states)}; "
            f"got {absolute.shape}"
        )
    if not (rtol >= 0.0 and np.all((absolute >= 0.0) & (absolute + rtol > 0.0) & (absolute + rtol < math.inf))):
        raise ValueError(f"rtol and atol must be finite, not negative and not both 0, got {rtol!r} and {atol!r}")
    most = real_number("max_steps", max_steps)
    if not (most >= 1.0 and (most == math.inf or most == int(most))):
        raise ValueError(f"max_steps must be a whole number, at least 1, or infinite, got {max_steps!r}")
    each = absolute if absolute.ndim else float(absolute)
    return Limits(float(t_end), rtol, each, math.inf if dt is None else dt, first_step, most)
