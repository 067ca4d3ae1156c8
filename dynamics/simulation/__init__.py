"""Simulation: the motion of a model from a start, as rows, events and statistics."""
