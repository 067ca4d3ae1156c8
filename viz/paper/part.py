"""A part of the paper: its section of the page, its files and its figures as data; what all parts share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from cgraph._shared import Json
from dynamics.experiments.text_table import csv_text

from ..graph_drawing.legend import to_adaptive
from ..graph_drawing.render import render_png
from ..pages.document import Block, Picture, Table
from ..plots import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SCALE = 160 / 96  # of a plot as PNG: 160 pixels an inch


class Part(NamedTuple):
    """One part of the paper: its section of the page, and what no block stands for.

    data: {name in figures.json: figures as plain data}.  other: {name: content} of further files.  moves: {id of an
    element: what the page's script reads there}, for figures that move.  script: what comes before that script.
    """

    name: str
    heading: str
    blocks: Sequence[Block]
    data: Mapping[str, Json]
    other: Mapping[str, str | bytes] = MappingProxyType({})
    moves: Mapping[str, Json] = MappingProxyType({})
    script: str = ""

    def files(self) -> dict[str, str | bytes]:
        """{name: content} of the pictures and tables that have a file, and of the others."""
        files: dict[str, str | bytes] = {}
        for block in self.blocks:
            if isinstance(block, Picture) and block.name:
                files[f"{block.name}.svg"] = block.svg
                if block.png:
                    files[f"{block.name}.png"] = render_png(block.svg, scale=block.png)
            elif isinstance(block, Table) and block.file:
                files[f"{block.file}.csv"] = csv_text(block.header, block.rows)
        return files | dict(self.other)


def plotted(name: str, figure: Figure, caption: str, alt: str) -> Picture:
    """A plot with its files.  alt: what is seen in it."""
    return Picture(name, plot.to_adaptive_svg(figure, background=True), caption, png=SCALE, alt=alt)


def drawn(name: str, svg: str, caption: str, width: str, alt: str) -> Picture:
    """A drawing with its files.  width: as of a `Picture`.  alt: what is seen in it."""
    return Picture(name, to_adaptive(svg), caption, width, png=2.0, alt=alt)
