"""Estimates: how far a run may be off, and advice on methods."""
