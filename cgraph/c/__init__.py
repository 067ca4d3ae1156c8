"""C: a graph as C99 source with its header. Knows nodes alone, so that `Graph` can offer it as a method."""

from .source import CSource, c_source

__all__ = ["CSource", "c_source"]
