"""The picture of an architecture: rooms on floors, arrows down to what they import."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import theme
from ..graph_drawing.draw_shapes import Arrow, Box, digraph, draw_arrows, draw_boxes
from ..theme import Paint
from .architecture import Architecture

if TYPE_CHECKING:
    from graphviz import Digraph

_COLORS = {"cgraph": theme.SKY_BLUE, "dynamics": theme.GREEN, "viz": theme.ORANGE}
_ROOM = {"shape": "box", "style": "filled,rounded", "height": "0.42", "margin": "0.16,0.06"}
_LOOSE = {**_ROOM, "style": "filled,dashed"}
_FAINT, _CLEAR, _WRONG = (
    {"color": "#C4C4C0", "penwidth": "0.7", "arrowsize": "0.5", "weight": "0"},
    {"penwidth": "1.5", "weight": "8"},
    {"color": theme.SPURIOUS, "penwidth": "2.5"},
)


def to_dot(plan: Architecture) -> Digraph:
    """The drawing of an architecture; each floor is a row, the highest at the top.

    A loose module has a dashed frame. An arrow that a longer way implies is faint; one that climbs is vermillion.
    The arrow from a to b has the id `a->b`.
    """
    drawing = digraph("TB")
    drawing.attr(ranksep="0.55", nodesep="0.3")
    boxes = {name: _box(plan, name) for name in plan.floors}
    for floor in sorted(set(plan.floors.values()), reverse=True):
        with drawing.subgraph() as row:
            row.attr(rank="same")
            draw_boxes(row, [boxes[name] for name, at in plan.floors.items() if at == floor])
    draw_arrows(drawing, [_arrow(plan, arrow) for arrow in plan.arrows])
    return drawing


def _box(plan: Architecture, name: str) -> Box:
    package, _, room = name.partition(".")
    color = _COLORS.get(package, theme.GRAY)
    look = _ROOM if name in plan.rooms else _LOOSE
    tooltip = f"{name}, floor {plan.floors[name]}"
    return Box(name, Paint(package, theme.tint(color, 0.3), color), {**look, "label": room or name, "tooltip": tooltip})


def _arrow(plan: Architecture, arrow: tuple[str, str]) -> Arrow:
    importer, imported = arrow
    look = _WRONG if plan.climbs(arrow) else _FAINT if plan.implied(arrow) else _CLEAR
    return Arrow(
        importer, imported, {"id": f"{importer}->{imported}", "edgetooltip": f"{importer} imports {imported}", **look}
    )
