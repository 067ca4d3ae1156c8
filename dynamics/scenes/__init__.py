"""Scenes: named models, models of files and models in Python, with a start."""

from .scenes import Scene, chain, is_model_file, load, names, of_file, of_model, spring_mass, triple_pendulum, two_link

__all__ = [
    "Scene",
    "chain",
    "is_model_file",
    "load",
    "names",
    "of_file",
    "of_model",
    "spring_mass",
    "triple_pendulum",
    "two_link",
]
