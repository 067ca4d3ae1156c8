"""Compilation: graphs to generated source or machine code that runs without walking nodes."""

from .cache import clear_cache
from .compile import compile
from .compiled import Compiled

__all__ = ["Compiled", "clear_cache", "compile"]
