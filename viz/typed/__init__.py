"""A Lagrangian that is typed: its equations, counted, checked and moving, in one page."""

from .page import box, typed_page
from .text import typed_text

__all__ = ["box", "typed_page", "typed_text"]
