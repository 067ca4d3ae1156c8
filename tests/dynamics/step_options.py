"""Step options: a length of step as the argument that a method takes it by."""

from dynamics.integrators import METHODS


def step(method: str, h: float) -> dict[str, float]:
    """dt for methods of equal steps, max_step for those that choose them."""
    equal = method in METHODS and not METHODS[method].adaptive
    return {"dt" if equal else "max_step": h}
