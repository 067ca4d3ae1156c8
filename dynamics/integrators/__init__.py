"""Integrators: Runge-Kutta tableaus as data, and the one loop that steps them."""

from .explicit import METHODS, Tableau, step

__all__ = ["METHODS", "Tableau", "step"]
