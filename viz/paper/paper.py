"""The paper's figures and table, each made from measured numbers and written to a folder with one page of all."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cgraph import Graph
from cgraph.extend import atomic_write, format_polynomial
from dynamics import momentum_rate, scenes, spurious_nodes
from dynamics.experiments.paper_numbers.embedding_error import law_of_arms
from dynamics.experiments.paper_numbers.equation3 import PAPER, equation3
from dynamics.experiments.paper_numbers.free_fall import fall, largest_differences, mujoco_fall
from dynamics.experiments.paper_numbers.node_scaling import FITTED_FROM, scaling
from dynamics.experiments.paper_numbers.table_1 import PAPER_MS, Row, table1
from dynamics.io.mujoco_render import frames
from dynamics.simulation.progress_bar import Progress

from .. import theme
from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import check_can_draw, render_png, render_svg
from ..pages import html
from ..pages.write_document import check_writable
from ..plots import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "euler_embedded": "by definition",
    "kinetic_only": "kinetic only",
    "chain_rule": "chain rule",
    "chain_rule_literal": "chain rule, literal",
}
COLOURS = dict(zip(TITLES.values(), (theme.SPURIOUS, theme.ORANGE, theme.BLUE, theme.PURPLE), strict=True))
SNAPSHOTS = 6


class Part(NamedTuple):
    """One part of the paper: its files {name: content}, its figures as plain data, and its section of the page."""

    name: str
    heading: str
    files: dict[str, str | bytes]
    data: dict[str, Any]
    section: str


def write_paper(folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """Write every figure, table and the page into `folder`, made if it is missing; returns all figures as plain data.

    say: called with a line before and after each part. Files are written one by one, each whole or not at all.
    """
    check_can_draw()
    plot.check_can_plot()
    check_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    makers = (equations, figure1, figure2, figure3, law, figures4_and_5, figure6, scaling_of_counts)
    parts = []
    for number, make in enumerate(makers, start=1):
        say(
            f"[{number}/{len(makers)}] {make.__doc__.splitlines()[0].rstrip('.') if make.__doc__ else make.__name__} ..."
        )
        part = make()
        for name, content in part.files.items():
            atomic_write(folder / name, content)
        say(f"      {', '.join(part.files)}")
        parts.append(part)
    data = {part.name: part.data for part in parts}
    atomic_write(folder / "figures.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    atomic_write(folder / "index.html", _page(parts))
    say(f"All of it on one page: {folder / 'index.html'}")
    return data


def equations() -> Part:
    """Equation (3), read off the graphs term by term."""
    found = [equation3(name) for name in ("euler_embedded", "kinetic_only", "chain_rule")]
    same = found[0].terms == PAPER
    lines = [f"{'paper, Eq. (3)':16} d/dt dL/dqd = {format_polynomial(PAPER)}"]
    lines += [f"{TITLES[each.formulation]:16} d/dt dL/dqd = {each}" for each in found]
    lines.append(f"By definition, the graph has the paper's terms, all of them and no other: {'yes' if same else 'NO'}")
    text = "\n".join(lines) + "\n"
    section = (
        html.paragraph(
            "One rotor on a spring: L = I qd²/2 − k q²/2. The inertial term of Lagrange's equation should be I qdd and "
            "nothing else. These lines are not typed in: each graph is expanded into its terms. qd0 is the velocity, "
            "q0_old the position one step of length dt earlier."
        )
        + html.preformatted(text)
        + html.point(
            "All terms with k are wrong. They come from embedding q = qd dt + q_old in the graph: differentiating by the "
            "velocity then also differentiates the spring's energy."
        )
    )
    data = {"equal_to_paper": same} | {each.formulation: str(each) for each in found}
    return Part("equations", "Equation (3) from the graph", {"equations.txt": text}, data, section)


def figure1() -> Part:
    """Figure 1: by definition, with the Euler relation embedded."""
    graph = _one_joint("euler_embedded")
    wrong = spurious_nodes(graph)
    edges = sum(edge.source in wrong for edge in graph.edges)
    caption = (
        f"Figure 1. By definition, with the Euler relation embedded. {len(wrong)} of {len(graph.nodes)} nodes and "
        f"{edges} of {len(graph.edges)} edges (in vermillion) are there by mistake: the spring's energy is attached to "
        "the momentum through θ = ω dt + θ old."
    )
    return _drawn("fig1", "Figure 1: by definition", graph, caption, spurious_nodes=len(wrong), spurious_edges=edges)


def figure2() -> Part:
    """Figure 2: kinetic energy only."""
    caption = (
        "Figure 2. Kinetic energy in place of L in the velocity derivative. The spring is gone from the inertial term, "
        "which is right here; the Euler relation ω = α dt + ω old is still in the graph."
    )
    return _drawn("fig2", "Figure 2: kinetic only", _one_joint("kinetic_only"), caption)


def figure3() -> Part:
    """Figure 3: the chain rule."""
    caption = (
        "Figure 3. The chain rule, τ = ∇p · (ω, α), from the full Lagrangian. No dt, no earlier state, and nothing of "
        "the spring: ω and θ stay independent."
    )
    return _drawn("fig3", "Figure 3: chain rule", _one_joint("chain_rule"), caption)


def law() -> Part:
    """The law of the embedding: torque error against dt."""
    found = law_of_arms()
    panels: dict[str, dict[str, tuple[Sequence[float], Sequence[float]]]] = {
        "error of the torque": {},
        "distance from its limit": {},
    }
    for each in found:
        name = f"{TITLES[each.formulation]}, n = {each.n}"
        panels["error of the torque"][name] = (each.dt.tolist(), each.error.tolist())
        panels["distance from its limit"][name] = (each.dt.tolist(), each.distance.tolist())
    picture = plot.powers(panels, "dt [s]", ["largest |Δτ| [N m]"] * 2, kinds=2)
    drawn = _pictures("law", picture)
    header = ("formulation", "links", "slope", "largest entry of the limit [N m]", "error at dt = 1e-6 s [N m]")
    rows = [
        (
            TITLES[each.formulation],
            str(each.n),
            f"{each.slope:.3f}" if np.isfinite(each.slope) else "exact",
            f"{np.abs(each.limit).max():.4g}",
            f"{each.error[-1]:.4g}",
        )
        for each in found
    ]
    caption = (
        "Left: the error does not vanish with dt. Right: the distance to τ + ∂L/∂q (by definition) and to τ + ∂K/∂q "
        "(kinetic only) vanishes with slope 1. Random states of planar arms."
    )
    section = (
        html.point(
            "A smaller time step does not help: by definition the whole term ∂L/∂q is lost, kinetic only the part ∂K/∂q."
        )
        + html.figure(drawn.svg, caption)
        + html.table("The law of the embedding", header, rows)
        + html.paragraph(
            "Kinetic only is exact for one joint, where K does not depend on q, and wrong for a real arm under this plain "
            "embedding. It is exact again if the momentum is taken before the relation is embedded. The paper calls its "
            "kinetic-only method accurate on three links; its program is not public, so which of the two it is is not known."
        )
    )
    files: dict[str, str | bytes] = {
        **drawn.files,
        "law.csv": _csv(header, rows),
    }
    data = {
        f"{each.formulation} n={each.n}": {"slope": _finite(each.slope), "limit": float(np.abs(each.limit).max())}
        for each in found
    }
    return Part("law", "How wrong, and why dt does not help", files, data, section)


def figures4_and_5() -> Part:
    """Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""
    scene = scenes.load("triple_pendulum")
    run = fall(scene)
    instants = np.linspace(0.0, scene.t_end, SNAPSHOTS)
    ours = plot.snapshots(run.trajectory.t, run.positions, instants.tolist())
    start = ", ".join(f"{each:.4g}" for each in scene.q)
    caption4 = (
        "Figure 4. The three-link arm in free fall by RK4 on the equations of motion from its own graph, with the way of "
        f"each joint. Start at rest at q = ({start}) rad, dt = 1e-3 s."
    )
    drawn4 = _pictures("fig4", ours)
    files: dict[str, str | bytes] = dict(drawn4.files)
    section = html.figure(drawn4.svg, caption4)
    data: dict[str, Any] = {"q_end": run.trajectory.q[-1].tolist()}
    try:
        other = mujoco_fall(run)
    except ImportError as error:
        section += html.point(f"Figure 5 is missing on this machine. {error}")
        return Part("fall", "Figures 4 and 5: the fall", files, data | {"mujoco": None}, section)

    rows_at = [int(np.abs(run.trajectory.t - instant).argmin()) for instant in instants]
    pictures = frames(scene.model, other.q[rows_at])
    if pictures is None:
        theirs = plot.snapshots(run.trajectory.t, other.positions, instants.tolist())
        source = "drawn from MuJoCo's body positions, as its renderer found no OpenGL on this machine"
    else:
        titles = [f"({letter})  t = {instant:.1f} s" for letter, instant in zip("abcdef", instants, strict=True)]
        theirs = plot.images(pictures, titles)
        source = "by MuJoCo's own renderer"
    caption5 = f"Figure 5. The same arm in MuJoCo {other.version} (RK4, same step) at the same instants, {source}."
    differences = largest_differences(run, other)
    header = ("up to t [s]", "largest |difference in q| [rad]")
    rows = [(f"{t:.2f}", f"{difference:.2e}") for t, difference in differences]
    drawn5 = _pictures("fig5", theirs)
    files |= {**drawn5.files, "fig5.csv": _csv(header, rows)}
    section += (
        html.figure(drawn5.svg, caption5)
        + html.table("Our trajectory and MuJoCo's", header, rows)
        + html.paragraph(
            "Both integrate by the classical Runge-Kutta method with the same step, so what differs is the equations of motion: "
            "ours from a Lagrangian by automatic differentiation, MuJoCo's from its composite-rigid-body algorithm."
        )
    )
    data |= {"mujoco": other.version, "figure5": source, "largest_difference": differences[-1][1]}
    return Part("fall", "Figures 4 and 5: the fall", files, data, section)


def figure6() -> Part:
    """Figure 6 and Table 1: the time of one evaluation, 1000 evaluations."""
    rows = table1()
    ways = list(rows[0].timings)
    base = {way: rows[-1].timings[way].median for way in ways}
    paper_base = PAPER_MS["chain_rule"][0]
    groups = {
        f"{way} [µs]": {TITLES[row.formulation]: (row.timings[way].mean, row.timings[way].deviation) for row in rows}
        for way in ways
    }
    groups["the paper [ms]"] = {TITLES[name]: value for name, value in PAPER_MS.items()}
    picture = plot.bars(groups, COLOURS)
    drawn = _pictures("fig6", picture)
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
            f"{PAPER_MS[row.formulation][0] / paper_base:.2f}",
            *(str(each) for each in (row.counts.nodes, row.counts.edges, row.counts.depth)),
            *(f"{row.timings[way].mean:.3g} ± {row.timings[way].deviation:.2g}" for way in ways),
            "{:.3g} ± {:.3g}".format(*PAPER_MS[row.formulation]),
        )
        for row in rows
    ]
    caption = (
        "Figure 6. Mean time of one evaluation of the three-link arm's inverse dynamics over 1000 random states, with "
        "one standard deviation. Each panel has its own scale; the paper's own figures are on the right."
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
    files: dict[str, str | bytes] = {
        **drawn.files,
        "table1.csv": _csv(header, table),
    }
    data = {
        row.formulation: {
            "nodes": row.counts.nodes,
            "edges": row.counts.edges,
            "depth": row.counts.depth,
            **{
                way: {"mean_us": each.mean, "sd_us": each.deviation, "median_us": each.median}
                for way, each in row.timings.items()
            },
        }
        for row in rows
    }
    return Part("table1", "Figure 6 and Table 1: the cost", files, data, section)


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


def scaling_of_counts() -> Part:
    """Scaling: nodes, edges and time over 1 to 40 links."""
    with Progress("scaling", 1.0) as progress:
        rows = scaling(report=progress)
    panels: dict[str, plot.Curves] = {
        "edges": {TITLES[row.formulation]: (row.n, [float(each) for each in row.edges]) for row in rows},
        "one compiled evaluation": {TITLES[row.formulation]: (row.n, row.microseconds) for row in rows},
    }
    picture = plot.powers(panels, "links n", ["edges", "time [µs]"], colours=COLOURS)
    drawn = _pictures("scaling", picture)
    header = (
        "formulation",
        "nodes ~ n^p",
        "edges ~ n^p",
        "time ~ n^p",
        "edges at n = 3",
        f"edges at n = {rows[0].n[-1]}",
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
    caption = (
        f"Inverse dynamics of chains of n equal rods. Exponents are fitted over n = {FITTED_FROM} to {rows[0].n[-1]}."
    )
    section = (
        html.point(
            "The embedding is not what makes a graph grow quadratically: by definition and the contracted chain rule both grow "
            "linearly. The chain rule taken literally, with the gradient of every momentum, is the quadratic one."
        )
        + html.figure(drawn.svg, caption)
        + html.table("Fitted exponents", header, table)
    )
    long = [
        (row.formulation, str(n), str(nodes), str(edges), f"{time:.3f}")
        for row in rows
        for n, nodes, edges, time in zip(row.n, row.nodes, row.edges, row.microseconds, strict=True)
    ]
    files: dict[str, str | bytes] = {
        **drawn.files,
        "scaling.csv": _csv(("formulation", "n", "nodes", "edges", "microseconds"), long),
    }
    data = {
        row.formulation: {"edges_exponent": row.fitted(row.edges), "nodes_exponent": row.fitted(row.nodes)}
        for row in rows
    }
    return Part("scaling", "Scaling with the number of links", files, data, section)


def _one_joint(formulation: str) -> Graph:
    """The inertial term of the rotor on a spring, with its momentum, as Figures 1 to 3 draw it."""
    return momentum_rate(scenes.load("spring_mass"), formulation, keep_momentum=True)


class _Pictures(NamedTuple):
    """A plot as the files of a part, and as the SVG that the page shows."""

    svg: str
    files: dict[str, str | bytes]


def _pictures(name: str, picture: Figure) -> _Pictures:
    """A plot rendered, once, as SVG and PNG."""
    svg = plot.to_svg(picture)
    return _Pictures(svg, {f"{name}.svg": svg, f"{name}.png": plot.to_png(picture)})


def _drawn(name: str, heading: str, graph: Graph, caption: str, **figures: int) -> Part:
    """A drawing of a graph as SVG, PNG and DOT, its counts in the caption."""
    counts = graph.counts()
    caption = f"{caption} {counts.nodes} nodes, {counts.edges} edges."
    drawing = to_dot(graph, names=theme.ONE_JOINT, marked=spurious_nodes(graph), clusters=False)
    svg = render_svg(drawing)
    files: dict[str, str | bytes] = {
        f"{name}.svg": svg,
        f"{name}.png": render_png(svg),
        f"{name}.dot": str(drawing.source),
    }
    data = {"nodes": counts.nodes, "edges": counts.edges, "depth": counts.depth} | figures
    return Part(name, heading, files, data, html.figure(svg, caption, width="auto"))


def _page(parts: Sequence[Part]) -> str:
    introduction = html.paragraph(
        "Lagrange's equation as a computational graph, after Kusaka and Tanaka, Robotics 2025, 14(9), 115. Three ways to write "
        "τ = d/dt ∂L/∂qd − ∂L/∂q: by definition with the Euler relation embedded (wrong), with the kinetic energy alone (right "
        "for one joint only), and by the chain rule (right). Every number on this page was measured when it was made."
    )
    return html.page(
        "The chain rule keeps q and qd apart", introduction, [(p.name, p.heading, p.section) for p in parts]
    )


def _csv(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return buffer.getvalue()


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
