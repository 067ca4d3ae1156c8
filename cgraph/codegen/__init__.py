"""Compilation: graphs to generated source or machine code that runs without walking nodes."""

from .compile import compile
from .compiled import Compiled
from .disk_cache import clear_cache

__all__ = ["Compiled", "clear_cache", "compile"]
