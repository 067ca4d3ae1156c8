"""Equation (3) and Figures 1 to 3: one rotor on a spring, by the three formulations."""

from __future__ import annotations

from cgraph import Graph
from cgraph.extend import format_polynomial
from dynamics import formulation_sizes, scenes
from dynamics.equations.formulations.blame import Blame
from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, blamed, formulation_size
from dynamics.experiments.paper_numbers import PAPER, equation3, torque_terms
from dynamics.experiments.text_table import csv_text

from .. import theme
from ..graph_drawing.dot import short_formulas, to_dot
from ..graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ..graph_drawing.render import render_png, render_svg
from ..pages import html
from ..pages.formulations import TITLES, WHY_FEWER, size_table
from .part import Part

EQUATION = "Lagrange's equation, τ = dp/dt − ∂L/∂θ"


def equations() -> Part:
    """Equation (3), read off the graphs term by term."""
    forms = [equation3(name) for name in ("euler_embedded", "kinetic_only", "chain_rule")]
    same = forms[0].terms == PAPER
    lines = [f"{'paper, Eq. (3)':16} d/dt dL/dqd = {format_polynomial(PAPER)}"]
    lines += [f"{TITLES[form.formulation]:16} d/dt dL/dqd = {form}" for form in forms]
    lines.append(f"By definition, the graph has the paper's terms, all of them and no other: {'yes' if same else 'NO'}")
    torques = {name: format_polynomial(torque_terms(name)) for name in ("euler_embedded", "kinetic_only", "chain_rule")}
    lines += ["", "The torque is what Lagrange's equation asks for, tau = d/dt dL/dqd - dL/dq:"]
    lines += [f"{TITLES[name]:16} tau = {torque}" for name, torque in torques.items()]
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
            "velocity then also differentiates the spring's energy. In the whole torque the first of them, −k q_old, meets "
            "the +k q of −∂L/∂q, which is right, and takes it away: without dt the spring is gone. An arm by definition "
            "weighs nothing."
        )
    )
    data = {"equal_to_paper": same} | {form.formulation: str(form) for form in forms} | {"torques": torques}
    return Part("equations", "Equation (3) from the graph", {"equations.txt": text}, data, section)


def figure1() -> Part:
    """Figure 1: by definition, with the Euler relation embedded."""
    size = formulation_size(*_one_joint("euler_embedded"))
    caption = (
        f"Figure 1. By definition, with the Euler relation embedded. {size.spurious_nodes} of {size.nodes} nodes and "
        f"{size.spurious_edges} of {size.edges} edges (in vermillion) are there by mistake: the spring's energy is "
        "attached to the momentum through θ = ω dt + θ old."
    )
    return _drawn("fig1", "Figure 1: by definition", "euler_embedded", caption)


def figure2() -> Part:
    """Figure 2: kinetic energy only."""
    caption = (
        "Figure 2. Kinetic energy in place of L in the velocity derivative. The spring is gone from the inertial term, "
        "which is right here; the Euler relation ω = α dt + ω old is still in the graph. Colors as above."
    )
    return _drawn("fig2", "Figure 2: kinetic only", "kinetic_only", caption)


def figure3() -> Part:
    """Figure 3: the chain rule."""
    caption = (
        "Figure 3. The chain rule, dp/dt = ∇p · (ω, α), from the full Lagrangian. No dt, no earlier state, and nothing "
        "of the spring: ω and θ stay independent. Colors as above."
    )
    return _drawn("fig3", "Figure 3: chain rule", "chain_rule", caption)


def sizes() -> Part:
    """The sizes of these graphs, and of those of the whole torque."""
    counted = formulation_sizes(scenes.load("spring_mass"))
    table = size_table(counted)
    section = (
        html.paragraph(
            f"Figures 1 to 3 draw the inertial term dp/dt of {EQUATION}, beside the momentum p = ∂L/∂ω. What the commands "
            "“cgraph lint” and “cgraph inspect” look at is the whole torque τ. Both are counted by one function."
        )
        + html.table(table.caption, table.header, table.rows)
        + html.paragraph(WHY_FEWER)
    )
    data = {f"{term}, {formulation}": size._asdict() for (term, formulation), size in counted.items()}
    return Part("sizes", "Sizes of the graphs", {"sizes.csv": csv_text(table.header, table.rows)}, data, section)


def _one_joint(formulation: str) -> tuple[Graph, Blame]:
    """The inertial term of the rotor on a spring, with its momentum, as Figures 1 to 3 draw it, and what is wrong in it."""
    return blamed(scenes.load("spring_mass"), INERTIAL_TERM, formulation)


def _drawn(name: str, heading: str, formulation: str, caption: str) -> Part:
    """A drawing of a graph as SVG, PNG and DOT, its counts in the caption. The legend of all stands above the first."""
    graph, wrong = _one_joint(formulation)
    size = formulation_size(graph, wrong)
    caption = f"{caption} {size.nodes} nodes, {size.edges} edges."
    drawing = to_dot(
        graph,
        names=theme.ONE_JOINT,
        formulas=short_formulas(graph, theme.ONE_JOINT),
        marked=wrong.nodes,
        marked_edges=wrong.edges,
        clusters=False,
        legend=False,
    )
    svg = to_adaptive(render_svg(drawing))
    files: dict[str, str | bytes] = {
        f"{name}.svg": svg,
        f"{name}.png": render_png(svg),
        f"{name}.dot": str(drawing.source),
    }
    section = html.figure(svg, caption, width="auto", adapts=True)
    if name == "fig1":
        legend = to_adaptive(legend_svg(kinds_in(graph, wrong.nodes)))
        files["legend.svg"] = legend
        section = html.figure(legend, "The colors of Figures 1 to 3.", width="auto", adapts=True) + section
    return Part(name, heading, files, size._asdict(), section)
