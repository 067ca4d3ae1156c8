"""Multiprecision: reference trajectories to many digits with a stated error, to measure others against."""

from .reference import REFERENCE_METHODS, reference
from .solution import Reference
from .taylor_integrator import ReferenceFailedError

__all__ = ["REFERENCE_METHODS", "Reference", "ReferenceFailedError", "reference"]
