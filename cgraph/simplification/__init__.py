"""Simplification: how derived nodes are built, graphs made smaller, and arithmetic of twice the digits."""
