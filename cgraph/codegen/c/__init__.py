"""C: a graph as C99 source with its header."""
