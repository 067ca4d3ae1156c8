"""Estimates: how far a run of equal steps may be off, and how large states are."""
