"""viz: pictures and pages of computational graphs."""

from .graph_drawing.dot import to_dot
from .graph_drawing.render import graph_svg, render_png, render_svg
from .inspector import page

__all__ = ["graph_svg", "page", "render_png", "render_svg", "to_dot"]
