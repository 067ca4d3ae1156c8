"""Constraints: their rank, their multipliers, and states projected onto them."""
