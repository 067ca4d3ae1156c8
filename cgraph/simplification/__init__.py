"""Simplification: how derived nodes are built, and graphs made smaller."""
