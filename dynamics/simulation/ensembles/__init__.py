"""Ensembles: many trajectories of one system, side by side, in threads or on other machines."""
