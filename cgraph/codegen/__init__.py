"""Compilation: graphs to generated source or machine code that runs without walking nodes."""

from .compile import compile
from .compiled import Compiled

__all__ = ["Compiled", "compile"]
