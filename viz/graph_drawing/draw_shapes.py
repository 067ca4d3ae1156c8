"""Shapes and lines as DOT, the language of Graphviz, in the fonts and colors of the theme."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cgraph._shared import required

from .. import theme

if TYPE_CHECKING:
    from graphviz import Digraph

Attributes = dict[str, str]
Arrow = tuple[str, str, Attributes]  # from and to which shape, and its looks

LEAF_SIZE = {"height": "0.34", "margin": "0.09,0.04"}
BOX = {**LEAF_SIZE, "shape": "box", "style": "filled,rounded"}


@dataclass(frozen=True)
class Box:
    """One shape of the drawing."""

    id: str
    kind: theme.Paint
    attributes: Attributes
    cluster: str | None = None


def digraph(rankdir: str) -> Digraph:
    """An empty drawing in the fonts and colors of the theme."""
    graphviz = required("graphviz", "drawing a graph needs the Python package graphviz", "viz")
    small = str(theme.SMALL_FONT_SIZE)
    font = {"fontname": theme.FONT, "fontcolor": theme.TEXT}
    drawing: Digraph = graphviz.Digraph(
        "graph",
        graph_attr={
            **font,
            "rankdir": rankdir,
            "ranksep": "0.32",
            "nodesep": "0.18",
            "overlap": "false",  # for the engines without layers
            "bgcolor": "white",
            "tooltip": " ",  # else the name of the graph
        },
        node_attr={**font, "fontsize": str(theme.FONT_SIZE), "width": "0.3"},
        edge_attr={**font, "fontsize": small, "color": theme.LINE, "arrowsize": "0.6", "labeldistance": "1.4"},
    )
    return drawing


def draw_boxes(drawing: Digraph, boxes: Sequence[Box]) -> None:
    """Add the boxes, those of a cluster inside its frame."""
    clusters: dict[str, list[Box]] = {}
    for box in boxes:
        if box.cluster is None:
            _draw_box(drawing, box)
        else:
            clusters.setdefault(box.cluster, []).append(box)
    for i, title in enumerate(sorted(clusters, key=theme.natural_order)):
        with drawing.subgraph(name=f"cluster_{i}") as frame:
            color = theme.SERIES[i % len(theme.SERIES)]
            frame.attr(**escaped({"id": f"t{i}", "label": title, "tooltip": title}), style="filled,rounded")
            frame.attr(color=color, fillcolor=theme.tint(color, 0.08), labeljust="l", margin="10", fontsize="12")
            for box in clusters[title]:
                _draw_box(frame, box)


def _draw_box(drawing: Digraph, box: Box) -> None:
    drawing.node(box.id, id=box.id, color=box.kind.line, fillcolor=box.kind.fill, **escaped(box.attributes))


def draw_legend(drawing: Digraph, boxes: Sequence[Box], words: Mapping[str, str], *, vertical: bool) -> None:
    """Add a frame with a box for each kind, in the order of the theme.  vertical: one below the other.

    words: {role: what the legend says of it}.
    """
    order = [paint.words for paint in (*theme.ROLES.values(), theme.OUTPUT, theme.COLLAPSED)]
    present = {box.kind.words: box.kind for box in boxes}
    rest = [text for text in present if text not in order]
    kinds = theme.in_words([present[text] for text in (*order, *rest) if text in present], words)
    with drawing.subgraph(name="cluster_legend") as frame:
        frame.attr(id="legend", label="legend", tooltip="legend", style="rounded", color=theme.LINE, fontsize="12")
        for i, kind in enumerate(kinds):
            look = {**BOX, "fontsize": "12", "width": "1.9"}
            _draw_box(frame, Box(f"k{i}", kind, {**look, "label": kind.words, "tooltip": kind.words}))
        if vertical:
            for i in range(len(kinds) - 1):
                frame.edge(f"k{i}", f"k{i + 1}", style="invis")


def escaped(attributes: Attributes) -> Attributes:
    """Attributes whose texts are shown as they are."""
    return {key: literal(value) for key, value in attributes.items()}


def literal(text: str) -> str:
    r"""A text to be shown as it is: Graphviz gives a meaning to \N, and to <...> as a whole."""
    from graphviz import escape

    escaped: str = escape(text)  # a subclass of str
    return escaped
