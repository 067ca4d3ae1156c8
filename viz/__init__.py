"""viz: pictures and pages of computational graphs."""

from .dot import to_dot
from .inspector import page
from .render import graph_svg, render_png, render_svg

__all__ = ["graph_svg", "page", "render_png", "render_svg", "to_dot"]
