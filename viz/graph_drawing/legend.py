"""A legend as a picture, small, for drawings that share their colors, and ink for dark pages."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from html import escape

from cgraph import Graph, Node

from .. import theme
from ..theme import Paint

LINE, SWATCH, GAP = 20, 14, 6  # points: of an entry's height, of its square, and beside it
LETTER = 0.6  # of the font's size, the width of a letter


def kinds_in(*graphs: Graph, marked: Collection[Node] = frozenset()) -> list[Paint]:
    """The kinds of nodes that drawings of the graphs have, in the order of the theme."""
    roles = {theme.role_of(node) for graph in graphs for node in graph.nodes if node not in marked}
    kinds = [paint for role, paint in theme.ROLES.items() if role in roles]
    return [*kinds, theme.OUTPUT, *([theme.MARKED] if marked else [])]


def legend_svg(kinds: Sequence[Paint], columns: int = 2) -> str:
    """The colors and words of the kinds, in so many columns.  Dark as `to_adaptive` makes it."""
    size = theme.SMALL_FONT_SIZE + 2
    column = SWATCH + 3 * GAP + max(len(kind.words) for kind in kinds) * LETTER * size
    entries = []
    for i, kind in enumerate(kinds):
        x, y = 1 + column * (i % columns), 1 + LINE * (i // columns)
        entries.append(
            f'<rect x="{x:.0f}" y="{y}" width="{SWATCH}" height="{SWATCH}" rx="3" '
            f'fill="{kind.fill}" stroke="{kind.line}"/>'
            f'<text x="{x + SWATCH + GAP:.0f}" y="{y + SWATCH - 3}" font-size="{size}">{escape(kind.words)}</text>'
        )
    width, height = column * min(columns, len(kinds)), LINE * -(-len(kinds) // columns)
    return (
        f'<svg width="{width:.0f}pt" height="{height}pt" viewBox="0 0 {width:.0f} {height}" '
        f'xmlns="http://www.w3.org/2000/svg"><g class="graph" font-family="{theme.FONT_FAMILIES}" fill="{theme.TEXT}">'
        f'<polygon fill="white" stroke="none" points="0,0 0,{height} {width:.0f},{height} {width:.0f},0"/>'
        f"{''.join(entries)}</g></svg>\n"
    )


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
    """SVG of `render_svg`, with ink and ground for dark pages where the reader's system asks for them."""
    head, rest = svg.split(">", 1)
    return f"{head}>\n{_DARK}{rest.lstrip()}"
