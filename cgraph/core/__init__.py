"""The graph: nodes, the table of operations, labels, and what can be asked of a graph."""
