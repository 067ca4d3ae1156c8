"""Drawings of graphs that follow the reader's choice of light or dark."""

from __future__ import annotations

from .. import theme

# Boxes keep their light paint, under dark letters; what lies between and around them changes: ground, lines and frames.
_DARK = f"""\
<style>@media (prefers-color-scheme: dark) {{
polygon[fill="white"][stroke="none"] {{ fill: {theme.DARK_PAGE}; }}
[stroke="{theme.LINE.lower()}"] {{ stroke: {theme.DARK_LINE}; }}
.edge polygon[fill="{theme.LINE.lower()}"] {{ fill: {theme.DARK_LINE}; }}
.cluster path, .cluster polygon {{ fill: none; }}
.graph > text, .cluster text, .edge text {{ fill: {theme.DARK_TEXT}; }}
}}</style>
"""


def to_adaptive(svg: str) -> str:
    """What `render_svg` returns, with ink and ground for dark pages where the reader's system asks for them."""
    head, rest = svg.split(">", 1)
    return f"{head}>\n{_DARK}{rest.lstrip()}"
