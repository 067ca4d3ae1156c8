"""Mechanisms from a few numbers."""
