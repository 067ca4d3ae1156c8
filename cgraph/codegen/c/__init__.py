"""C: a graph as C99 source with its header."""

from .c_source import CSource, to_c

__all__ = ["CSource", "to_c"]
