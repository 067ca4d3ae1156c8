"""Mechanisms that change: impacts, releases, and what a scene does not need."""
