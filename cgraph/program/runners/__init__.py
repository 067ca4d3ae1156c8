"""Runners: programs in Python and as machine code."""
