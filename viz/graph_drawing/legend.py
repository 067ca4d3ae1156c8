"""A legend as a picture, small, for drawings that share their colors, and ink for dark pages."""

from collections.abc import Collection, Sequence
from html import escape

from cgraph import Graph, Node

from .. import theme
from ..theme import Paint

LINE, SWATCH, WIDE, GAP = 20, 14, 20, 6  # points: of an entry's height, its shape's height and width, and beside it
LETTER = 0.53  # of the font's size, the width of a letter


def kinds_in(*graphs: Graph, marked: Collection[Node] = frozenset()) -> list[Paint]:
    """The kinds of nodes that drawings of the graphs have, in the order of the theme."""
    roles = {theme.role_of(node) for graph in graphs for node in graph.nodes if node not in marked}
    kinds = [paint for role, paint in theme.ROLES.items() if role in roles]
    return [*kinds, theme.OUTPUT, *([theme.MARKED] if marked else [])]


def legend_svg(kinds: Sequence[Paint], columns: int = 2, *, notes: Sequence[tuple[str, float, str, str]] = ()) -> str:
    """The shapes, colors and words of the kinds, in so many columns.  Dark as `to_adaptive` makes it.

    notes: of arrows, (color, width in points, text beside the arrow, words).
    """
    size = theme.SMALL_FONT_SIZE + 2
    words = [*[kind.words for kind in kinds], *[text for *_, text in notes]]
    column = WIDE + 3 * GAP + max(map(len, words)) * LETTER * size
    entries = []
    for i, text in enumerate(words):
        x, y = 1 + column * (i % columns), 1 + LINE * (i // columns)
        symbol = _shape(kinds[i], x, y) if i < len(kinds) else _arrow(*notes[i - len(kinds)][:3], x, y)
        entries.append(
            f'{symbol}<text x="{x + WIDE + GAP:.0f}" y="{y + SWATCH - 3}" font-size="{size}">{escape(text)}</text>'
        )
    width, height = column * min(columns, len(words)), LINE * -(-len(words) // columns)
    return (
        f'<svg width="{width:.0f}pt" height="{height}pt" viewBox="0 0 {width:.0f} {height}" '
        f'xmlns="http://www.w3.org/2000/svg"><g class="graph" font-family="{theme.FONT_FAMILIES}" fill="{theme.TEXT}">'
        f'<polygon fill="white" stroke="none" points="0,0 0,{height} {width:.0f},{height} {width:.0f},0"/>'
        f"{''.join(entries)}</g></svg>\n"
    )


def _shape(kind: Paint, x: float, y: float) -> str:
    """The shape of a kind in drawings: an ellipse for operations, a box for inputs, a double one for outputs."""
    look = f'fill="{kind.fill}" stroke="{kind.line.lower()}"'
    if kind == theme.OUTPUT:
        inner = f'x="{x + 2:.0f}" y="{y + 2}" width="{WIDE - 4}" height="{SWATCH - 4}"'
        return f'<rect x="{x:.0f}" y="{y}" width="{WIDE}" height="{SWATCH}" {look}/><rect {inner} {look}/>'
    if kind in (theme.ROLES["input"], theme.ROLES["constant"], theme.COLLAPSED):
        return f'<rect x="{x:.0f}" y="{y}" width="{WIDE}" height="{SWATCH}" rx="3" {look}/>'
    rx, ry = WIDE / 2, SWATCH / 2
    return f'<ellipse cx="{x + rx:.0f}" cy="{y + ry:.0f}" rx="{rx:.0f}" ry="{ry:.0f}" {look}/>'


def _arrow(color: str, width: float, text: str, x: float, y: float) -> str:
    """An arrow to the right, or a text in its place."""
    if text:
        return f'<text x="{x:.0f}" y="{y + SWATCH - 3}" font-size="{theme.SMALL_FONT_SIZE}">{escape(text)}</text>'
    tip, middle = x + WIDE, y + SWATCH / 2
    path = f"M{x:.0f} {middle:.0f}H{tip:.0f}m-6 -4l6 4l-6 4"
    return f'<path d="{path}" fill="none" stroke="{color.lower()}" stroke-width="{width}"/>'


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
