"""A Lagrangian that is typed: its equations, counted, checked and moving, in one page."""

from .text_page import box, typed_page

__all__ = ["box", "typed_page"]
