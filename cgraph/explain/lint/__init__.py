"""Lint: what a person declares of a graph, checked, with a proof or the nodes and edges to blame."""
