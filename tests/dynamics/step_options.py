"""Step options: a length of step, and a tolerance, as the arguments that a method takes them by."""

from typing import Any

from dynamics.integrators import METHODS


def step(method: str, h: float, **tolerances: float) -> dict[str, Any]:
    """dt for methods of equal steps, without an estimate of their error; max_step and tolerances for the others."""
    if method in METHODS and not METHODS[method].adaptive:
        return {"dt": h, "estimate_error": False}
    return {"max_step": h, **tolerances}
