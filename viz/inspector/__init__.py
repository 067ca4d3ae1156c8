"""The inspector: one page on which a graph is unfolded, stepped through, asked and seen moving."""

from .content import Motion, StateTable, Table, Version
from .page import Page, page

__all__ = ["Motion", "Page", "StateTable", "Table", "Version", "page"]
