"""Multiprecision: reference trajectories to many digits with a stated error, to measure others against."""

from .reference import METHODS, reference
from .taylor import ReferenceFailedError
from .trajectory import Reference

__all__ = ["METHODS", "Reference", "ReferenceFailedError", "reference"]
