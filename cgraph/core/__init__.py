"""The core: nodes, graphs, and the table of operations, which is filled before any node is made."""

from . import ops as ops
