"""The core: nodes, graphs, and both modes of differentiation, of operations that stand elsewhere.

To be read after docs/core.md, each file for what it adds to the section there: `row`, `label`, `scope`, `node`,
`traversal`, `builder`, `evaluation`, `forward`, `reverse`, `graph`; the others when they come up.
"""
