"""Ensembles: many trajectories of one system, side by side, in threads or on other machines."""

from .ensemble import Ensemble, EnsembleStats
from .simulate_many import simulate_many

__all__ = ["Ensemble", "EnsembleStats", "simulate_many"]
