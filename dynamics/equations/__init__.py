"""Equations: the graphs that a Lagrangian gives, in any of its formulations."""
