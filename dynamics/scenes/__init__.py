"""Scenes: named models and models of files with a start."""

from .scenes import Scene, chain, load, names, of_file, spring_mass, triple_pendulum

__all__ = ["Scene", "chain", "load", "names", "of_file", "spring_mass", "triple_pendulum"]
