"""Step options: a length of step, and a tolerance, as the arguments that a method takes them by; kinds of methods."""

from typing import Any

from dynamics import METHODS
from dynamics.integrators.tableau import COMPOSITIONS
from tests.slow import slow

ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
EQUAL = [name for name in METHODS if name not in ADAPTIVE]
# Compositions differ in their coefficients alone: of those a short and a long one, for what holds of every method.
LIKE_OTHERS = [name for name in COMPOSITIONS if name not in ("yoshida4", "kahan_li6")]
EVERY_METHOD = [*[name for name in METHODS if name not in LIKE_OTHERS], *slow(*LIKE_OTHERS)]


def step(method: str, h: float, **tolerances: float) -> dict[str, Any]:
    """dt for methods of equal steps, without an estimate of their error; max_step and tolerances for the others."""
    if method in METHODS and not METHODS[method].adaptive:
        return {"dt": h, "estimate_error": False}
    return {"max_step": h, **tolerances}
