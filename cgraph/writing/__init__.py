"""Writing: formulas, names, source lines, hashes, and a graph as one of networkx."""
