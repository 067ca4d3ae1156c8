"""Equation (3) and Figures 1 to 3: one rotor on a spring, by the three formulations."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cgraph import Graph
from cgraph.extend import Polynomial, expand, format_polynomial
from dynamics import formulation_sizes, inverse_dynamics, momentum_rate, scenes
from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, blamed, formulation_size

from .. import theme
from ..graph_drawing.dot import plain_drawing
from ..graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ..graph_drawing.render import render_svg
from ..pages.document import Block, Listing, Paragraph, Picture
from ..pages.formulation_table import TITLES, WHY_FEWER, size_table
from .part import Part, drawn

EQUATION = "Lagrange's equation, τ = dp/dt − ∂L/∂θ"


# The paper's right-hand side, I qdd - k (qdd dt^2 + 2 qd dt + q_old), as coefficients.
PAPER: Polynomial = {
    (("I", 1), ("qdd0", 1)): 1.0,
    (("dt", 2), ("k", 1), ("qdd0", 1)): -1.0,
    (("dt", 1), ("k", 1), ("qd0", 1)): -2.0,
    (("k", 1), ("q0_old", 1)): -1.0,
}


@dataclass(frozen=True)
class Equation:
    """One formulation's d/dt dL/dqd for L = I qd^2/2 - k q^2/2, term by term."""

    formulation: str
    terms: Polynomial

    def __str__(self) -> str:
        return format_polynomial(self.terms)


def equation3(formulation: str) -> Equation:
    """The terms of the graph of that formulation; qd0 stands for the embedded velocity qdd0 dt + qd0_old."""
    return Equation(formulation, _terms(momentum_rate(scenes.load("spring_mass"), formulation)))


def torque_terms(formulation: str) -> Polynomial:
    """The terms of the whole torque, d/dt dL/dqd - dL/dq, of that formulation."""
    return _terms(inverse_dynamics(scenes.load("spring_mass"), formulation))


def _terms(graph: Graph) -> Polynomial:
    velocity = {node: "qd0" for node in graph.nodes if node.args and node.name == "qd0"}
    return expand(graph.only_output(), velocity)


def equations() -> Part:
    """Equation (3), read off the graphs term by term."""
    forms = [equation3(name) for name in ("by_definition", "kinetic_only", "chain_rule")]
    same = forms[0].terms == PAPER
    lines = [f"{'paper, Eq. (3)':16} d/dt dL/dqd = {format_polynomial(PAPER)}"]
    lines += [f"{TITLES[form.formulation]:16} d/dt dL/dqd = {form}" for form in forms]
    lines.append(f"By definition, the graph has the paper's terms, all of them and no other: {'yes' if same else 'NO'}")
    torques = {name: format_polynomial(torque_terms(name)) for name in ("by_definition", "kinetic_only", "chain_rule")}
    lines += ["", "The torque is what Lagrange's equation asks for, tau = d/dt dL/dqd - dL/dq:"]
    lines += [f"{TITLES[name]:16} tau = {torque}" for name, torque in torques.items()]
    text = "\n".join(lines) + "\n"
    blocks: list[Block] = [
        Paragraph(
            "One rotor on a spring: L = I qd²/2 − k q²/2. The inertial term of Lagrange's equation should be I qdd and "
            "nothing else. These lines are not typed in: each graph is expanded into its terms. qd0 is the velocity, "
            "q0_old the position one step of length dt earlier."
        ),
        Listing(text),
        Paragraph(
            "All terms with k are wrong. They come from embedding q = qd dt + q_old in the graph: differentiating by the "
            "velocity then also differentiates the spring's energy. In the whole torque the first of them, −k q_old, cancels "
            "the correct +k q of −∂L/∂q: as dt tends to 0 the spring is gone. In the same way an arm by definition "
            "weighs nothing.",
            point=True,
        ),
    ]
    data = {"equal_to_paper": same} | {form.formulation: str(form) for form in forms} | {"torques": torques}
    return Part("equations", "Equation (3) from the graph", blocks, data, {"equations.txt": text})


FIGURES = {  # name: heading, formulation, caption
    "fig1": (
        "Figure 1: by definition",
        "by_definition",
        (
            "Figure 1. By definition, with the Euler relation embedded. {spurious_nodes} of {nodes} nodes and {spurious_edges} "
            "of {edges} edges (in vermillion) are there by mistake: the spring's energy is attached to the momentum through "
            "θ = ω dt + θ old."
        ),
    ),
    "fig2": (
        "Figure 2: kinetic only",
        "kinetic_only",
        (
            "Figure 2. Kinetic energy in place of L in the velocity derivative. The spring is gone from the inertial term, "
            "which is right here; the Euler relation ω = α dt + ω old is still in the graph. Colors as above."
        ),
    ),
    "fig3": (
        "Figure 3: chain rule",
        "chain_rule",
        (
            "Figure 3. The chain rule, dp/dt = ∇p · (ω, α), from the full Lagrangian. No dt, no earlier state, and nothing "
            "of the spring: ω and θ stay independent. Colors as above."
        ),
    ),
}


def figure(name: str) -> Part:
    """One of Figures 1 to 3, the inertial term of the rotor on a spring with its momentum, its counts in the caption.

    The legend of all stands above the first.
    """
    heading, formulation, words = FIGURES[name]
    graph, wrong = blamed(scenes.load("spring_mass"), INERTIAL_TERM, formulation)
    size = formulation_size(graph, wrong)
    caption = f"{words.format(**size._asdict())} {size.nodes} nodes, {size.edges} edges."
    drawing = plain_drawing(graph, theme.ONE_JOINT, wrong.nodes, wrong.edges)
    blocks = [drawn(name, render_svg(drawing), caption, "auto")]
    if name == "fig1":
        legend = to_adaptive(legend_svg(kinds_in(graph, marked=wrong.nodes)))
        blocks.insert(0, Picture("legend", legend, "The colors of Figures 1 to 3.", "auto"))
    return Part(name, heading, blocks, size._asdict(), {f"{name}.dot": str(drawing.source)})


def sizes() -> Part:
    """The sizes of these graphs, and of those of the whole torque."""
    counted = formulation_sizes(scenes.load("spring_mass"))
    blocks: list[Block] = [
        Paragraph(
            f"Figures 1 to 3 draw the inertial term dp/dt of {EQUATION}, beside the momentum p = ∂L/∂ω. What the commands "
            "“cgraph lint” and “cgraph inspect” look at is the whole torque τ. Both are counted by one function."
        ),
        replace(size_table(counted), file="sizes"),
        Paragraph(WHY_FEWER),
    ]
    data = {f"{term}, {formulation}": size._asdict() for (term, formulation), size in counted.items()}
    return Part("sizes", "Sizes of the graphs", blocks, data)
