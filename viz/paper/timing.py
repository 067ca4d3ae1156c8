"""Figure 6 and Table 1: the time of one evaluation of each formulation."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Counts
from cgraph._shared import Json
from dynamics import inverse_dynamics, scenes
from dynamics.experiments.timing import spent

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots import plot
from .eager import eager_evaluations
from .part import Part, plotted

EVALUATIONS = 1000  # as in the paper
PAPER = "the paper"  # among ways of evaluating
# The paper's Table 1: mean and standard deviation over 1000 evaluations, in ms.
PAPER_MS = {"by_definition": (51.7, 9.62), "kinetic_only": (43.8, 8.03), "chain_rule": (6.29, 1.15)}


class Timing(NamedTuple):
    """Median and quartiles of one evaluation, in microseconds: one interruption does not move them."""

    median: float
    lower: float  # a quarter of the evaluations take less
    upper: float  # a quarter take more


class Row(NamedTuple):
    """One formulation: its graph's size and its cost by each way of evaluating it."""

    formulation: str
    counts: Counts
    timings: dict[str, Timing]  # {"interpreted" | "compiled" | "PyTorch eager": ...}


def table_1(evaluations: int = EVALUATIONS) -> list[Row]:
    """The three formulations, each evaluated at random states; formulations take turns, so that drift is shared.

    PyTorch eager, which builds its graph anew at every evaluation, is measured beside ours where torch is installed.
    """
    scene = scenes.load("triple_pendulum")
    graphs = {name: inverse_dynamics(scene, name) for name in PAPER_MS}
    runs: dict[str, Mapping[str, Callable[[np.ndarray], object]]] = {
        "interpreted": {name: _interpreted(graph) for name, graph in graphs.items()},
        "compiled": {name: cg.compile(graph, "python") for name, graph in graphs.items()},
    }
    if eager := eager_evaluations(scene.system, PAPER_MS):
        runs["PyTorch eager"] = eager
    rng = np.random.default_rng(0)
    states = {
        name: np.where([x == "dt" for x in graph.input_names], 1e-3, rng.normal(size=(evaluations, len(graph.inputs))))
        for name, graph in graphs.items()
    }
    timings: dict[str, dict[str, Timing]] = {name: {} for name in graphs}
    for way, functions in runs.items():
        for name, function in functions.items():
            function(states[name][0])  # warm
        seconds: dict[str, list[float]] = {name: [] for name in functions}
        for k in range(evaluations):
            for name, function in functions.items():
                seconds[name].append(spent(partial(function, states[name][k])).seconds)
        for name, taken in seconds.items():
            timings[name][way] = Timing(*[float(share) * 1e6 for share in np.quantile(taken, (0.5, 0.25, 0.75))])
    return [Row(name, graph.counts(), timings[name]) for name, graph in graphs.items()]


def _interpreted(graph: cg.Graph) -> Callable[[np.ndarray], object]:
    names = graph.input_names
    return lambda x: graph.evaluate(dict(zip(names, x.tolist(), strict=True)))


def figure6(evaluations: int = EVALUATIONS) -> Part:
    """Figure 6 and Table 1: the time of one evaluation.

    evaluations: random states, each evaluated once by each formulation in turn.
    """
    rows = table_1(evaluations)
    caption = (
        "Figure 6. Time of one evaluation of the three-link arm's inverse dynamics, as a ratio to the chain rule's: medians over "
        f"{evaluations} random states, with lines from the lower to the upper quartile. On the right the paper's own (Section 4.2): "
        "means with one standard deviation."
    )
    ratios = _ratios(rows)
    seen, papers = (
        ", ".join([f"{name} {ratio:.2f}" for name, (ratio, *_) in ratios[way].items()]) for way in ("compiled", PAPER)
    )
    alt = f"Bars of three formulations for each way of evaluating. Compiled: {seen}. The paper: {papers}."
    blocks: list[Block] = [
        Table("Table 1: ratios of medians to the chain rule's, and sizes", *_table(rows, ratios), file="table1"),
        Paragraph(_why(rows), point=True),
        plotted("fig6", plot.bars(ratios, COLORS, "time, chain rule = 1"), caption, alt),
        Table("Times of one evaluation", *_times(rows), folded=True, file="table1-times"),
        Paragraph(
            "Interpreted: node by node in Python. Compiled: one generated Python function. PyTorch eager, measured where torch "
            "is installed, builds and differentiates its graph anew at every evaluation. "
            "Kinetic only has a few nodes more than by definition: it needs both ∂K/∂θ and ∂L/∂θ, where by definition needs "
            "∂L/∂θ alone."
        ),
    ]
    data = {row.formulation: _figures(row) for row in rows}
    return Part("table1", "Figure 6 and Table 1: the time of an evaluation", blocks, {"table1": data})


def _ratios(rows: Sequence[Row]) -> dict[str, dict[str, Timing]]:
    """{way of evaluating, the paper's the last: {formulation: its times by the median of the chain rule}}."""
    times = {way: {TITLES[row.formulation]: row.timings[way] for row in rows} for way in rows[0].timings}
    times[PAPER] = {TITLES[name]: Timing(mean, mean - sd, mean + sd) for name, (mean, sd) in PAPER_MS.items()}
    return {
        way: {name: Timing(*[time / each[TITLES["chain_rule"]].median for time in row]) for name, row in each.items()}
        for way, each in times.items()
    }


def _table(rows: Sequence[Row], ratios: Mapping[str, Mapping[str, Timing]]) -> tuple[list[str], list[list[str]]]:
    """Table 1: header and rows; ratios are of medians."""
    header = ["formulation", *[f"{way.removeprefix('the ')}, ratio" for way in ratios], "nodes", "edges", "depth"]
    table = [
        [
            TITLES[row.formulation],
            *[f"{each[TITLES[row.formulation]].median:.2f}" for each in ratios.values()],
            *[str(count) for count in (row.counts.nodes, row.counts.edges, row.counts.depth)],
        ]
        for row in rows
    ]
    return header, table


def _times(rows: Sequence[Row]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The times: header and a row for each way of evaluating each formulation; the paper's are of another machine."""
    header = ("formulation", "evaluated", "median", "lower quartile", "upper quartile", "unit")
    table = [
        (TITLES[row.formulation], way, *[f"{time:.3g}" for time in timing], "µs")
        for row in rows
        for way, timing in row.timings.items()
    ]
    table += [
        (TITLES[name], "the paper: mean ± std. dev.", *(f"{t:.3g}" for t in (mean, mean - sd, mean + sd)), "ms")
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
        "these graphs, and its program is not public. Over many links the order in which derivatives are contracted matters far "
        "more than the embedding, see Figure 9."
    )
