"""The live motion: a panel that computes a system's motion in the page."""

from .live_panel import Live, page_text, panel

__all__ = ["Live", "page_text", "panel"]
