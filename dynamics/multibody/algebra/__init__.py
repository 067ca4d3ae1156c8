"""Rotations, twists and wrenches as nodes."""
