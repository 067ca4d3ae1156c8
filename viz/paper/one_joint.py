"""Equation (3) and Figures 1 to 3: one rotor on a spring, by the three formulations."""

from __future__ import annotations

from cgraph import Graph
from cgraph.extend import format_polynomial
from dynamics import momentum_rate, scenes, spurious_nodes
from dynamics.experiments.paper_numbers.equation3 import PAPER, equation3

from .. import theme
from ..graph_drawing.dot import to_dot
from ..graph_drawing.render import render_png, render_svg
from ..pages import html
from .part import TITLES, Part


def equations() -> Part:
    """Equation (3), read off the graphs term by term."""
    forms = [equation3(name) for name in ("euler_embedded", "kinetic_only", "chain_rule")]
    same = forms[0].terms == PAPER
    lines = [f"{'paper, Eq. (3)':16} d/dt dL/dqd = {format_polynomial(PAPER)}"]
    lines += [f"{TITLES[form.formulation]:16} d/dt dL/dqd = {form}" for form in forms]
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
    data = {"equal_to_paper": same} | {form.formulation: str(form) for form in forms}
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


def _one_joint(formulation: str) -> Graph:
    """The inertial term of the rotor on a spring, with its momentum, as Figures 1 to 3 draw it."""
    return momentum_rate(scenes.load("spring_mass"), formulation, keep_momentum=True)


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
