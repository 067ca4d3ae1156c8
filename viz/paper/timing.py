"""Figure 6 and Table 1: the time of one evaluation of each formulation."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Counts
from dynamics import inverse_dynamics, scenes
from dynamics.experiments.timing import spent

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots import plot
from .part import Part, plotted

EVALUATIONS = 1000  # as in the paper
PAPER = "the paper"  # among ways of evaluating
FIGURES = ("median_us", "lower_quartile_us", "upper_quartile_us")  # a `Timing` as plain data
# The paper's Table 1: mean and standard deviation over 1000 evaluations, in ms.
PAPER_MS = {"by_definition": (51.7, 9.62), "kinetic_only": (43.8, 8.03), "chain_rule": (6.29, 1.15)}


class Timing(NamedTuple):
    """Median and quartiles of one evaluation, in microseconds: one interruption does not move them."""

    median: float
    lower: float  # a quarter of the evaluations take less
    upper: float  # a quarter take more


Times = Mapping[str, Mapping[str, Timing]]  # {way of evaluating: {formulation: what it takes}}


def table_1(evaluations: int = EVALUATIONS) -> tuple[dict[str, Counts], Times]:
    """The sizes of the three formulations, and their times at random states; they take turns, so that drift is shared.

    Ways are "interpreted" and "compiled".
    """
    scene = scenes.load("triple_pendulum")
    graphs = {name: inverse_dynamics(scene, name) for name in PAPER_MS}
    runs: dict[str, Mapping[str, Callable[[np.ndarray], object]]] = {
        "interpreted": {name: _interpreted(graph) for name, graph in graphs.items()},
        "compiled": {name: cg.compile(graph, "python") for name, graph in graphs.items()},
    }
    rng = np.random.default_rng(0)
    states = {
        name: np.where([x == "dt" for x in graph.input_names], 1e-3, rng.normal(size=(evaluations, len(graph.inputs))))
        for name, graph in graphs.items()
    }
    times = dict[str, dict[str, Timing]]()
    for way, functions in runs.items():
        for name, function in functions.items():
            function(states[name][0])  # warm
        seconds: dict[str, list[float]] = {name: [] for name in functions}
        for k in range(evaluations):
            for name, function in functions.items():
                seconds[name].append(spent(partial(function, states[name][k])).seconds)
        quantiles = {name: np.quantile(taken, (0.5, 0.25, 0.75)) for name, taken in seconds.items()}
        times[way] = {name: Timing(*[float(share) * 1e6 for share in found]) for name, found in quantiles.items()}
    return {name: graph.counts() for name, graph in graphs.items()}, times


def _interpreted(graph: cg.Graph) -> Callable[[np.ndarray], object]:
    names = graph.input_names
    return lambda x: graph.evaluate(dict(zip(names, x.tolist(), strict=True)))


def figure6(evaluations: int = EVALUATIONS) -> Part:
    """Figure 6 and Table 1: the time of one evaluation.

    evaluations: random states, each evaluated once by each formulation in turn.
    """
    sizes, times = table_1(evaluations)
    caption = (
        "Figure 6. Time of one evaluation of the three-link arm's inverse dynamics, as a ratio to the chain rule's: medians over "
        f"{evaluations} random states, with lines from the lower to the upper quartile. On the right the paper's own (Section 4.2): "
        "means with one standard deviation."
    )
    ratios = _ratios(times)
    seen, papers = (
        ", ".join([f"{name} {ratio:.2f}" for name, (ratio, *_) in ratios[way].items()]) for way in ("compiled", PAPER)
    )
    alt = f"Bars of three formulations for each way of evaluating. Compiled: {seen}. The paper: {papers}."
    blocks: list[Block] = [
        Table("Table 1: ratios of medians to the chain rule's, and sizes", *_table(sizes, ratios), file="table1"),
        Paragraph(_why(sizes, times), point=True),
        plotted("fig6", plot.bars(ratios, COLORS, "time, chain rule = 1"), caption, alt),
        Table("Times of one evaluation", *_times(times), folded=True, file="table1-times"),
        Paragraph(
            "Interpreted: node by node in Python. Compiled: one generated Python function. "
            "Kinetic only has a few nodes more than by definition: it needs both ∂K/∂θ and ∂L/∂θ, where by definition needs "
            "∂L/∂θ alone."
        ),
    ]
    data = {
        name: {"nodes": size.nodes, "edges": size.edges, "depth": size.depth}
        | {way: dict(zip(FIGURES, each[name], strict=True)) for way, each in times.items()}
        for name, size in sizes.items()
    }
    return Part("table1", "Figure 6 and Table 1: the time of an evaluation", blocks, {"table1": data})


def _ratios(times: Times) -> dict[str, dict[str, Timing]]:
    """{way of evaluating, the paper's the last: {title of a formulation: its times by the median of the chain rule}}."""
    papers = {name: Timing(mean, mean - sd, mean + sd) for name, (mean, sd) in PAPER_MS.items()}
    return {
        way: {TITLES[name]: Timing(*[time / each["chain_rule"].median for time in row]) for name, row in each.items()}
        for way, each in {**times, PAPER: papers}.items()
    }


def _table(sizes: Mapping[str, Counts], ratios: Times) -> tuple[list[str], list[list[str]]]:
    """Table 1: header and rows; ratios are of medians."""
    header = ["formulation", *[f"{way.removeprefix('the ')}, ratio" for way in ratios], "nodes", "edges", "depth"]
    table = [
        [
            TITLES[name],
            *[f"{each[TITLES[name]].median:.2f}" for each in ratios.values()],
            *[str(count) for count in (size.nodes, size.edges, size.depth)],
        ]
        for name, size in sizes.items()
    ]
    return header, table


def _times(times: Times) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """The times: header and a row for each way of evaluating each formulation; the paper's are of another machine."""
    header = ("formulation", "evaluated", "median", "lower quartile", "upper quartile", "unit")
    table = [
        (TITLES[name], way, *[f"{time:.3g}" for time in each[name]], "µs")
        for name in PAPER_MS
        for way, each in times.items()
    ]
    table += [
        (TITLES[name], "the paper: mean ± std. dev.", *(f"{t:.3g}" for t in (mean, mean - sd, mean + sd)), "ms")
        for name, (mean, sd) in PAPER_MS.items()
    ]
    return header, table


def _why(sizes: Mapping[str, Counts], times: Times) -> str:
    """Two sentences on the ratio of by definition to the chain rule, from the measured counts."""
    nodes = sizes["by_definition"].nodes / sizes["chain_rule"].nodes
    compiled = times["compiled"]["by_definition"].median / times["compiled"]["chain_rule"].median
    return (
        f"By definition costs {compiled:.2f} times the chain rule because its graph has {nodes:.2f} times the nodes: the "
        "embedded relation, and the adjoints and tangents that pass through it. The paper's larger ratio does not follow from "
        "these graphs, and its program is not public. Over many links the order in which derivatives are contracted matters far "
        "more than the embedding, see Figure 9."
    )
