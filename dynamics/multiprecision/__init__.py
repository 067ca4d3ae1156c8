"""Multiprecision: reference trajectories to many digits with a stated error, to measure others against."""

from .reference import Reference, reference
from .taylor_integrator import ReferenceFailedError

__all__ = ["Reference", "ReferenceFailedError", "reference"]
