"""The core: nodes, graphs, and both modes of differentiation, of operations that stand elsewhere."""
