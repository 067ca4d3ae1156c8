"""The live motion: a panel that computes a system's motion in the page, by WebAssembly."""

from .page import EVALUATION, Live, Panel, page_text, panel

__all__ = ["EVALUATION", "Live", "Panel", "page_text", "panel"]
