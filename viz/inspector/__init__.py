"""The inspector: one page on which a graph is unfolded, stepped through, asked and seen moving."""

from .content import Motion, Table, Version
from .page import Page, page

__all__ = ["Motion", "Page", "Table", "Version", "page"]
