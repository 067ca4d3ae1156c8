"""A part of the paper: its files, its figures as data and its section of the page; what all parts share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from cgraph.extend import Json

from ..graph_drawing.render import render_png
from ..plots import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCALE = 160 / 96  # of a plot as PNG: 160 pixels an inch


class Part(NamedTuple):
    """One part of the paper: its files {name: content}, its figures as plain data, and its section of the page."""

    name: str
    heading: str
    files: dict[str, str | bytes]
    data: Mapping[str, Json]
    section: str


class Pictures(NamedTuple):
    """A plot as the files of a part, and as the SVG that the page shows."""

    svg: str
    files: dict[str, str | bytes]


def pictures(name: str, picture: Figure) -> Pictures:
    """A plot rendered, once, as SVG, and as PNG from that SVG."""
    svg = plot.to_adaptive_svg(picture, background=True)
    return Pictures(svg, {f"{name}.svg": svg, f"{name}.png": render_png(svg, scale=SCALE)})
