"""A Lagrangian that is typed: its equations, counted, checked and moving, in one page."""

from .page import box, typed_page
from .text import text_or_none, typed_text

__all__ = ["box", "text_or_none", "typed_page", "typed_text"]
