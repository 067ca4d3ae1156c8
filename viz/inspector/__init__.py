"""The inspector: one page on which a graph is unfolded, stepped through, asked and seen moving."""

from ..pages.document import Table
from ..pages.html import Panel
from .content import Motion, StateTable, Step, Version
from .page import page

__all__ = ["Motion", "Panel", "StateTable", "Step", "Table", "Version", "page"]
