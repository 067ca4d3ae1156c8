"""Stability: stiff and extreme cases, a verdict for each."""
