"""The kinds of statements, each with its rules: calls of graphs, matrices, branches and loops, numbers moved about."""
