"""The Euler edge: a time step inside the graph, and what it does to the torque, however small it is."""

from __future__ import annotations

import numpy as np

from cgraph import Graph
from dynamics import Verdict, formulation_sizes, formulation_verdict, inverse_dynamics
from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, blamed

from .. import theme
from ..graph_drawing.dot import plain_drawing
from ..graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ..graph_drawing.render import render_svg
from ..pages.document import Picture, Table
from ..pages.formulation_table import TITLES, WHY_FEWER, size_table
from ..pages.mathml import equations
from .subject import SHOWN, Screen, Subject, lagrangian_graph, number

STEPS = (1.0, 0.1, 0.01, 1e-3, 1e-6)  # s
DRAWN = 60  # nodes, at most, of a graph that is drawn


def euler_edge(subject: Subject) -> Screen:
    """The screen of a system."""
    right = inverse_dynamics(subject.system, "chain_rule")
    verdict = formulation_verdict(subject.scene, "by_definition")
    wrong = verdict.graph
    torque = subject.evaluate(right)
    errors = [(dt, _after_a_step(subject, wrong, dt) - torque) for dt in STEPS]
    last = float(np.abs(errors[-1][1]).max())
    stays = bool(verdict.excess_at(subject.values))
    return Screen(
        "euler-edge",
        "A time step in the graph",
        4,
        _story(subject),
        "We shrink dt from a second to a millionth of a second. The error of the torque by definition …",
        ("vanishes with dt", "tends to something that is not zero", "grows beyond all bounds"),
        1 if stays else 0,
        _reveal(subject, errors, stays, verdict) + _second_try(subject, torque),
        "Move dt, and the state. Both torques are those of the graphs, computed in this page. Blue bars: the torque; orange: by definition.",
        subject.play(
            "step",
            {"right": right, "wrong": wrong},
            sliders=subject.sliders(),
            joints=subject.joints[:SHOWN],
            colors=[theme.FORMULATIONS["chain_rule"], theme.FORMULATIONS["by_definition"]],
        ),
        f"At dt = 1e-6 s the largest error is {number(last)}. {_expected(stays, verdict)} Listen for “but velocity does move position!” True along a motion, and the chain "
        "rule uses it; not in ∂L/∂q̇, where a state is varied that nothing has moved yet.",
    )


def _expected(stays: bool, verdict: Verdict) -> str:
    """Expectation of the teacher."""
    if stays:
        return "Expect hands for A: a smaller step cures almost every other error of a simulation."
    if not verdict.differs:
        return "A is right of this system: ∂L/∂q is zero at every state. With a weight or a spring it is B."
    return "A is right at this state, where ∂L/∂q is zero. Move the state: where it is not, the error stays."


def _after_a_step(subject: Subject, wrong: Graph, dt: float) -> np.ndarray:
    """The torques of an embedded graph at the same state after a step dt."""
    moved = {name: value for name, value in subject.values.items() if name.endswith("_old")}
    shrunk = {
        name: now + (value - now) * dt / subject.values["dt"]
        for name, value in moved.items()
        for now in [subject.values[name.removesuffix("_old")]]
    }
    return subject.evaluate(wrong, dt=dt, **shrunk)


def _story(subject: Subject) -> str:
    return (
        "<p>The Lagrangian, kinetic minus potential energy:</p>"
        + equations(lagrangian_graph(subject.system), subject.names)
        + "<p>Lagrange's equation asks for the torque <b>τ = dp/dt − ∂L/∂q</b> with the momentum p = ∂L/∂q̇. Its first "
        "term dp/dt is the <b>inertial term</b>. But the graph of L has no input for time. One way out is to write into "
        "the graph what a simulation does, q̇ = q̈ dt + q̇<sub>old</sub> and <b>q = q̇ dt + q<sub>old</sub></b>, and "
        "to differentiate with respect to dt. The paper calls this the differentiation “by definition”.</p>"
    )


def _reveal(subject: Subject, errors: list[tuple[float, np.ndarray]], stays: bool, verdict: Verdict) -> str:
    said = (
        "<p><b>B.</b> q = q̇ dt + q<sub>old</sub> is an edge from velocity to position. A change of q̇ now changes q "
        "as well, so p gains dt · ∂L/∂q. A small dt makes that small. But then we differentiate <em>with respect to</em> dt, and the "
        "derivative of dt · ∂L/∂q has a plain ∂L/∂q in it, at any step: the inertial term tends to dp/dt + ∂L/∂q. In the "
        "whole torque this cancels the correct −∂L/∂q of Lagrange's equation. Weight and "
        "springs are in ∂L/∂q: <b>at rest the arm weighs nothing.</b></p>"
        if stays
        else "<p><b>A.</b> The edge q̇ → q is there, and p gains dt · ∂L/∂q by it. What stays of the error at the smallest "
        "step is ∂L/∂q, and that is zero at this state.</p>"
    )
    joints = subject.joints[:SHOWN]
    rows = [[number(dt), *[number(error) for error in each[: len(joints)]]] for dt, each in errors]
    steps = Table("Error of the torque by definition", ["dt [s]", *joints], rows).html()
    sizes = size_table(formulation_sizes(subject.system)).html()
    why = f"<p>{verdict.lacking or WHY_FEWER}</p>" * verdict.differs
    return said + _drawing(subject) + steps + sizes + why


def _second_try(subject: Subject, right: np.ndarray) -> str:
    """The kinetic energy alone, which is right where it does not depend on the place."""
    verdict = formulation_verdict(subject.scene, "kinetic_only")
    off = float(np.abs(_after_a_step(subject, verdict.graph, STEPS[-1]) - right).max())
    error, torque = number(off), number(float(np.abs(right).max()))
    if verdict.excess_at(subject.values):
        told = (
            f"Here the torque is then still off by {error} of {torque}: the inertia at a joint "
            "depends on the positions of the others, so K contains positions, and the edge acts on them."
        )
    elif verdict.differs:
        told = (
            f"At this state the torque is then right, to {error} of {torque}. But K contains positions: "
            "where its slope with respect to them is not zero, the torque is wrong."
        )
    else:
        told = f"Here the torque is then right, to {error} of {torque}: K does not depend on position."
    return (
        "<p><b>A second try</b> keeps the step and takes the kinetic energy K alone for the momentum, since weight and springs "
        f"are not in it. {told} The chain rule needs neither trick.</p>"
    )


def _drawing(subject: Subject) -> str:
    """The inertial term by definition and by the chain rule, where they are small enough for a picture."""
    pictures = ""
    for formulation in ("by_definition", "chain_rule"):
        graph, (wrong, edges, _) = blamed(subject.system, INERTIAL_TERM, formulation)
        if len(graph.nodes) > DRAWN:
            return ""
        if not pictures:
            legend = legend_svg(kinds_in(graph, marked=wrong))
            pictures = Picture("", to_adaptive(legend), "The colors of both pictures.", None).html()
        svg = render_svg(plain_drawing(graph, subject.names, wrong, edges))
        caption = (
            f"The inertial term, {TITLES[formulation]}: {len(wrong)} of {len(graph.nodes)} nodes are there by mistake."
        )
        pictures += Picture("", to_adaptive(svg), caption, None).html()
    return pictures
