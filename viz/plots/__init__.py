"""Plots: arrays to matplotlib figures."""
