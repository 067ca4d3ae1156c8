"""Scaling: nodes, edges and time of each formulation as links are added."""

from __future__ import annotations

from collections.abc import Sequence

from dynamics.experiments.paper_numbers.node_scaling import COUNTS, FITTED_FROM, NodeScaling, node_scaling
from dynamics.experiments.text_table import csv_text
from dynamics.simulation.progress_bar import Progress

from ..pages import html
from ..pages.formulations import COLORS, TITLES
from ..plots import plot
from .part import Part, pictures


def scaling_of_counts(links: Sequence[int] = COUNTS) -> Part:
    """Scaling: nodes, edges and time over the number of links.

    links: of the chains, in growing order, with 3 among them.
    """
    with Progress("scaling", 1.0) as progress:
        rows = node_scaling(links, report=progress)
    panels: dict[str, plot.Curves] = {
        "edges": {TITLES[row.formulation]: (row.n, [float(count) for count in row.edges]) for row in rows},
        "one compiled evaluation": {TITLES[row.formulation]: (row.n, row.microseconds) for row in rows},
    }
    drawn = pictures("scaling", plot.powers(panels, "links n", ["edges", "time [µs]"], colors=COLORS))
    header, table = _exponents(rows, links[-1])
    caption = f"Inverse dynamics of chains of n equal rods. Exponents are fitted over n = {FITTED_FROM} to {links[-1]}."
    section = (
        html.point(
            "The embedding is not what makes a graph grow quadratically: by definition and the contracted chain rule both grow "
            "linearly. The chain rule taken literally, with the gradient of every momentum, is the quadratic one."
        )
        + html.figure(drawn.svg, caption)
        + html.table("Fitted exponents", header, table)
    )
    points = [
        (row.formulation, str(n), str(nodes), str(edges), f"{time:.3f}")
        for row in rows
        for n, nodes, edges, time in zip(row.n, row.nodes, row.edges, row.microseconds, strict=True)
    ]
    files = drawn.files | {"scaling.csv": csv_text(("formulation", "n", "nodes", "edges", "microseconds"), points)}
    data = {
        row.formulation: {"edges_exponent": row.fitted(row.edges), "nodes_exponent": row.fitted(row.nodes)}
        for row in rows
    }
    return Part("scaling", "Scaling with the number of links", files, data, section)


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
