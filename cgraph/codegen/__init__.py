"""Compilation: graphs to generated source that runs without walking nodes."""

from .compiled import Compiled, compile

__all__ = ["Compiled", "compile"]
