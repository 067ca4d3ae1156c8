"""Limits: what a run is held to, its end, its steps and its errors, checked in one place."""

from __future__ import annotations

import math


def check_limits(
    t_end: float, dt: float | None, first_step: float | None, rtol: float, atol: float, max_steps: float
) -> None:
    """Raises ValueError, naming the argument, unless times [s] are positive and finite and tolerances make sense."""
    for what, value in (("t_end", t_end), ("dt", dt), ("first_step", first_step)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{what} must be positive and finite, got {value!r} s")
    if not (rtol >= 0.0 and atol >= 0.0 and 0.0 < rtol + atol < math.inf):
        raise ValueError(f"rtol and atol must be finite, not negative and not both 0, got {rtol!r} and {atol!r}")
    if not max_steps >= 1:
        raise ValueError(f"max_steps must be at least 1, got {max_steps!r}")
