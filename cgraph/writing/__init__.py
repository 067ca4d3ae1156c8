"""Writing: a graph as text, formulas, counts, hashes, records, and as a graph of networkx."""
