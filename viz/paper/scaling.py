"""Scaling: nodes, edges and time of each formulation as links are added."""

from __future__ import annotations

from collections.abc import Sequence

from dynamics.experiments.paper_numbers import COUNTS, FITTED_FROM, NodeScaling, node_scaling
from dynamics.experiments.text_table import csv_text
from dynamics.simulation.progress_bar import Progress

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots.direct_labels import Line, PlotPanel, labeled
from .part import Part, plotted


def scaling_of_counts(links: Sequence[int] = COUNTS) -> Part:
    """Scaling: nodes, edges and time over the number of links.

    links: of the chains, in growing order, with 3 among them.
    """
    with Progress("scaling", 1.0) as progress:
        rows = node_scaling(links, report=progress)
    header, table = _exponents(rows, links[-1])
    caption = f"Inverse dynamics of chains of n equal rods. Exponents are fitted over n = {FITTED_FROM} to {links[-1]}."
    blocks: list[Block] = [
        Paragraph(
            "The embedding is not what makes a graph grow quadratically: by definition and the contracted chain rule both grow "
            "linearly. The chain rule taken literally, with the gradient of every momentum, is the quadratic one.",
            point=True,
        ),
        plotted("scaling", labeled(_panels(rows), shared=False, rising=True, room=0.35), caption),
        Table("Fitted exponents", header, table),
    ]
    points = [
        (row.formulation, str(n), str(nodes), str(edges), f"{time:.3f}")
        for row in rows
        for n, nodes, edges, time in zip(row.n, row.nodes, row.edges, row.microseconds, strict=True)
    ]
    points_csv = csv_text(("formulation", "n", "nodes", "edges", "microseconds"), points)
    data = {
        row.formulation: {"edges_exponent": row.fitted(row.edges), "nodes_exponent": row.fitted(row.nodes)}
        for row in rows
    }
    return Part("scaling", "Scaling with the number of links", blocks, data, {"scaling.csv": points_csv})


def _panels(rows: Sequence[NodeScaling]) -> list[PlotPanel]:
    """Edges and times over the number of links, beside lines of slope 1 and 2."""
    panels = []
    for title, y, of in (("edges", "edges", "edges"), ("one compiled evaluation", "time [µs]", "microseconds")):
        lines = [
            Line(TITLES[row.formulation], row.n, [float(value) for value in getattr(row, of)],
                 COLORS[TITLES[row.formulation]])
            for row in rows
        ]  # fmt: skip
        # guides over the fitted part: slope 1 below all curves, slope 2 above them
        links = [n for n in rows[0].n if n >= FITTED_FROM]
        at = [line.y[rows[0].n.index(links[0])] for line in lines]
        for power, start in ((1, 0.5 * min(at)), (2, 2.0 * max(at))):
            lines.append(Line(f"slope {power}", links, [start * (n / links[0]) ** power for n in links], None))
        panels.append(PlotPanel(title, "links n", y, lines))
    return panels


def _exponents(rows: Sequence[NodeScaling], longest: int) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The table of fitted exponents: header and rows."""
    header = (
        "formulation",
        "nodes ~ n^p",
        "edges ~ n^p",
        "time ~ n^p",
        "edges at n = 3",
        f"edges at n = {longest}",
    )
    table = [
        (
            TITLES[row.formulation],
            *(f"{row.fitted(values):.2f}" for values in (row.nodes, row.edges, row.microseconds)),
            str(row.edges[row.n.index(3)]),
            str(row.edges[-1]),
        )
        for row in rows
    ]
    return header, table
