"""Figure 6 and Table 1: the time of one evaluation of each formulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cgraph.extend import Json
from dynamics.experiments.paper_numbers import PAPER_MS, Row, table_1

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots import plot
from .part import Part, plotted

if TYPE_CHECKING:
    from matplotlib.figure import Figure


EVALUATIONS = 1000  # as in the paper


def figure6(evaluations: int = EVALUATIONS) -> Part:
    """Figure 6 and Table 1: the time of one evaluation.

    evaluations: random states, each evaluated once by each formulation in turn.
    """
    rows = table_1(evaluations)
    caption = (
        f"Figure 6. Median time of one evaluation of the three-link arm's inverse dynamics over {evaluations} random "
        "states; the lines reach from the lower to the upper quartile. Each panel has its own scale. The paper's own "
        "figures, on the right, are means with one standard deviation."
    )
    blocks: list[Block] = [
        Table("Table 1: ratios of medians to the chain rule's, and sizes", *_ratios(rows), file="table1"),
        Paragraph(_why(rows), point=True),
        plotted("fig6", _bars(rows), caption),
        Table("Times of one evaluation", *_times(rows), file="table1-times"),
        Paragraph(
            "Interpreted: node by node in Python. Compiled: one generated Python function. PyTorch eager, measured where torch "
            "is installed, builds and differentiates its graph anew at every evaluation. "
            "Kinetic only has a few nodes more than by definition: it needs both ∂K/∂q and ∂L/∂q, where by definition needs "
            "∂L/∂q alone."
        ),
    ]
    data = {row.formulation: _figures(row) for row in rows}
    return Part("table1", "Figure 6 and Table 1: the cost", blocks, data)


def _bars(rows: Sequence[Row]) -> Figure:
    """A panel for each way of evaluating, and one for the paper's own times."""
    groups = {f"{way} [µs]": {TITLES[row.formulation]: row.timings[way] for row in rows} for way in rows[0].timings}
    bars = {panel: {name: (t.median, t.lower, t.upper) for name, t in group.items()} for panel, group in groups.items()}
    bars["the paper [ms]"] = {TITLES[name]: (mean, mean - sd, mean + sd) for name, (mean, sd) in PAPER_MS.items()}
    return plot.bars(bars, COLORS)


def _ratios(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Table 1: header and rows; ratios are of medians, to the chain rule's, which is the last row."""
    ways = list(rows[0].timings)
    base = {way: rows[-1].timings[way].median for way in ways}
    header = ("formulation", *(f"{way}, ratio" for way in ways), "paper, ratio", "nodes", "edges", "depth")
    table = [
        (
            TITLES[row.formulation],
            *(f"{row.timings[way].median / base[way]:.2f}" for way in ways),
            f"{PAPER_MS[row.formulation][0] / PAPER_MS['chain_rule'][0]:.2f}",
            *(str(count) for count in (row.counts.nodes, row.counts.edges, row.counts.depth)),
        )
        for row in rows
    ]
    return header, table


def _times(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The times: header and a row for each way of evaluating each formulation; the paper's are of another machine."""
    header = ("formulation", "evaluated", "median", "lower quartile", "upper quartile", "unit")
    table = [
        (TITLES[row.formulation], way, *(f"{time:.3g}" for time in (timing.median, timing.lower, timing.upper)), "µs")
        for row in rows
        for way, timing in row.timings.items()
    ]
    table += [
        (TITLES[name], "the paper: mean, ∓ one deviation", *(f"{t:.3g}" for t in (mean, mean - sd, mean + sd)), "ms")
        for name, (mean, sd) in PAPER_MS.items()
    ]
    return header, table


def _figures(row: Row) -> dict[str, Json]:
    """A row as plain data."""
    times = {
        way: {"median_us": timing.median, "lower_quartile_us": timing.lower, "upper_quartile_us": timing.upper}
        for way, timing in row.timings.items()
    }
    return {"nodes": row.counts.nodes, "edges": row.counts.edges, "depth": row.counts.depth, **times}


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
