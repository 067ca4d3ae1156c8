"""Sweeps over a tree of bodies: motions outward, composites inward, and what they give."""
