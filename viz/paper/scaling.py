"""Scaling: nodes, edges and time of each formulation as links are added."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import cgraph as cg
from dynamics import inverse_dynamics, planar_arm
from dynamics.experiments.text_table import csv_text
from dynamics.experiments.timing import exponent, spent
from dynamics.simulation.outcome import Progress

from ..pages.document import Block, Paragraph, Table
from ..pages.formulation_table import COLORS, TITLES
from ..plots.direct_labels import Line, PlotPanel, labeled
from .part import Part, plotted

COUNTS = (1, 2, 3, 4, 6, 8, 10, 14, 20, 28, 40)
FITTED_FROM = 6  # links; below, the fixed part of the graph bends the curve
EXACT_FROM = 3  # links: from there on another link adds the same
SCALED = ("by_definition", "kinetic_only", "chain_rule", "chain_rule_literal")


@dataclass(frozen=True)
class NodeScaling:
    """One formulation over chains of n equal rods; exponents are fitted over n >= 6."""

    formulation: str
    n: tuple[int, ...]
    nodes: tuple[int, ...]
    edges: tuple[int, ...]
    microseconds: tuple[float, ...]  # one compiled evaluation, best of several

    def fitted(self, values: Sequence[float]) -> float:
        """The exponent of `values`, one of this row's columns, over n >= 6."""
        kept = [(n, value) for n, value in zip(self.n, values, strict=True) if n >= FITTED_FROM]
        return exponent(*zip(*kept, strict=True))


def node_scaling(counts: Sequence[int], report: Callable[[float], None]) -> list[NodeScaling]:
    """Sizes of each formulation of `SCALED` over arms of `counts` links. report: called with the share done."""
    rows, done, total = [], 0, len(SCALED) * sum(n * n for n in counts)
    for formulation in SCALED:
        nodes, edges, micros = [], [], []
        for n in counts:
            graph = inverse_dynamics(planar_arm([1.0] * n, [1.0] * n), formulation)
            nodes.append(len(graph.nodes))
            edges.append(len(graph.edges))
            micros.append(_microseconds(graph))
            done += n * n
            report(done / total)
        rows.append(NodeScaling(formulation, tuple(counts), tuple(nodes), tuple(edges), tuple(micros)))
    return rows


def _microseconds(graph: cg.Graph) -> float:
    function = cg.compile(graph, "python").values
    x = np.random.default_rng(0).normal(size=len(graph.inputs)).tolist()
    tens = [spent(lambda: [function(x) for _ in range(10)]) for _ in range(7)]
    return min(each.seconds for each in tens) / 10.0 * 1e6


def scaling_of_counts(links: Sequence[int] = COUNTS) -> Part:
    """Scaling: nodes, edges and time over the number of links.

    links: of the chains, in growing order, with 3 among them.
    """
    with Progress("scaling", 1.0) as progress:
        rows = node_scaling(links, report=progress)
    header = ["formulation", "nodes ~ n^p", "edges ~ n^p", "time ~ n^p", "edges", "edges at n = 3"]
    table = [
        [
            TITLES[row.formulation],
            *[f"{row.fitted(values):.2f}" for values in (row.nodes, row.edges, row.microseconds)],
            _law_text(edge_law(row)),
            str(row.edges[row.n.index(3)]),
            str(row.edges[-1]),
        ]
        for row in rows
    ]
    caption = (
        f"Figure 9. Inverse dynamics of chains of n equal rods, up to n = {links[-1]}; the paper's Section 4.2 expects O(n²) of the "
        f"embedding and O(n) of the chain rule. Exponents are fitted over n = {FITTED_FROM} to {links[-1]}, where the constant part "
        "of a graph still bends the curve."
    )
    laws = {row.formulation: edge_law(row) for row in rows}
    seen = "; ".join(
        [f"{TITLES[row.formulation]} {row.edges[-1]} edges and {row.microseconds[-1]:.3g} µs" for row in rows]
    )
    blocks: list[Block] = [
        Paragraph(_answer(laws), point=True),
        plotted(
            "scaling",
            labeled(_panels(rows), shared=False, rising=True, room=0.35),
            caption,
            f"Curves of edges and of times over the number of links. At n = {links[-1]}: {seen}.",
        ),
        Table(
            f"Growth with the number of links n; polynomials hold exactly from n = {EXACT_FROM} on",
            [*header, f"edges at n = {links[-1]}"],
            table,
        ),
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
    return Part(
        "scaling", "Figure 9: growth with the number of links", blocks, {"scaling": data}, {"scaling.csv": points_csv}
    )


def edge_law(row: NodeScaling) -> tuple[int, ...]:
    """Coefficients of the polynomial in n, constant first, that the edges lie on exactly from n = `EXACT_FROM` on.

    Of a degree below 3, and confirmed by one number more than it has coefficients; without one, none.
    """
    points = [(n, edges) for n, edges in zip(row.n, row.edges, strict=True) if n >= EXACT_FROM]
    for degree in range(3):
        n, edges = np.array(points, dtype=float).T
        if len(points) < degree + 2:
            break
        found = [round(float(c)) for c in np.polynomial.polynomial.polyfit(n, edges, degree)]
        if all(sum([c * k**power for power, c in enumerate(found)]) == size for k, size in points):
            return tuple(found)
    return ()


def _law_text(law: Sequence[int]) -> str:
    """A polynomial as text, 196 n − 172."""
    terms = [(c, ("", "n", "n²")[power]) for power, c in reversed(list(enumerate(law))) if c]
    text = "".join([f"{' − ' if c < 0 else ' + '}{abs(c)}{name and f' {name}'}" for c, name in terms])
    return text.removeprefix(" + ") or "no polynomial"


def _answer(laws: Mapping[str, Sequence[int]]) -> str:
    """What grows how, as far as the counts are exactly so."""
    linear = [TITLES[name] for name, law in laws.items() if len(law) == 2]
    quadratic = [TITLES[name] for name, law in laws.items() if len(law) == 3]
    return (
        f"Each further link adds the same number of edges, so growth is linear: {_listed(linear)}. It adds ever more where the gradient "
        f"of every momentum is taken, so growth is quadratic: {_listed(quadratic)}. The embedding is not what makes a graph grow quadratically."
    )


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names) or "none"


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
