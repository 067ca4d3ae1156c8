"""Explanations of a graph: what of it is not as declared, why outputs depend on inputs, how two differ."""
