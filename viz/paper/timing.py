"""Figure 6 and Table 1: the time of one evaluation of each formulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dynamics.experiments.paper_numbers.table_1 import PAPER_MS, Row, table_1
from dynamics.experiments.text_table import csv_text

from ..pages import html
from ..pages.formulations import COLORS, TITLES
from ..plots import plot
from .part import Part, pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EVALUATIONS = 1000  # as in the paper


def figure6(evaluations: int = EVALUATIONS) -> Part:
    """Figure 6 and Table 1: the time of one evaluation.

    evaluations: random states, each evaluated once by each formulation in turn.
    """
    rows = table_1(evaluations)
    header, table = _table(rows)
    drawn = pictures("fig6", _bars(rows))
    caption = (
        f"Figure 6. Mean time of one evaluation of the three-link arm's inverse dynamics over {evaluations} random "
        "states, with one standard deviation. Each panel has its own scale; the paper's own figures are on the right."
    )
    section = (
        html.table(
            "Table 1: ratios of medians to the chain rule's, sizes, and mean ± standard deviation", header, table
        )
        + html.point(_why(rows))
        + html.figure(drawn.svg, caption)
        + html.paragraph(
            "Interpreted: node by node in Python. Compiled: one generated Python function. PyTorch eager, measured where torch "
            "is installed, builds and differentiates its graph anew at every evaluation. "
            "Kinetic only has a few nodes more than by definition: it needs both ∂K/∂q and ∂L/∂q, where by definition needs "
            "∂L/∂q alone."
        )
    )
    files = drawn.files | {"table1.csv": csv_text(header, table)}
    data = {row.formulation: _figures(row) for row in rows}
    return Part("table1", "Figure 6 and Table 1: the cost", files, data, section)


def _bars(rows: Sequence[Row]) -> Figure:
    """A panel for each way of evaluating, and one for the paper's own times."""
    groups = {
        f"{way} [µs]": {TITLES[row.formulation]: (row.timings[way].mean, row.timings[way].deviation) for row in rows}
        for way in rows[0].timings
    }
    groups["the paper [ms]"] = {TITLES[name]: value for name, value in PAPER_MS.items()}
    return plot.bars(groups, COLORS)


def _table(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Table 1: header and rows; ratios are of medians, to the chain rule's, which is the last row."""
    ways = list(rows[0].timings)
    base = {way: rows[-1].timings[way].median for way in ways}
    header = (
        "formulation",
        *(f"{way}, ratio" for way in ways),
        "paper, ratio",
        "nodes",
        "edges",
        "depth",
        *(f"{way} [µs]" for way in ways),
        "paper [ms]",
    )
    table = [
        (
            TITLES[row.formulation],
            *(f"{row.timings[way].median / base[way]:.2f}" for way in ways),
            f"{PAPER_MS[row.formulation][0] / PAPER_MS['chain_rule'][0]:.2f}",
            *(str(count) for count in (row.counts.nodes, row.counts.edges, row.counts.depth)),
            *(f"{row.timings[way].mean:.3g} ± {row.timings[way].deviation:.2g}" for way in ways),
            "{:.3g} ± {:.3g}".format(*PAPER_MS[row.formulation]),
        )
        for row in rows
    ]
    return header, table


def _figures(row: Row) -> dict[str, Any]:
    """A row as plain data."""
    times = {
        way: {"mean_us": timing.mean, "sd_us": timing.deviation, "median_us": timing.median}
        for way, timing in row.timings.items()
    }
    return {"nodes": row.counts.nodes, "edges": row.counts.edges, "depth": row.counts.depth} | times


def _why(rows: Sequence[Row]) -> str:
    """Two sentences on the ratio of by definition to the chain rule, from the measured counts."""
    flawed, proposed = rows[0], rows[-1]
    nodes = flawed.counts.nodes / proposed.counts.nodes
    compiled = flawed.timings["compiled"].median / proposed.timings["compiled"].median
    return (
        f"By definition costs {compiled:.2f} times the chain rule because its graph has {nodes:.2f} times the nodes: the "
        "embedded relation, and the adjoints and tangents that pass through it. The paper's larger ratio does not follow from "
        "the graphs, and its program is not public; over many links the order in which derivatives are contracted matters far "
        "more than the embedding, as the last section shows."
    )
