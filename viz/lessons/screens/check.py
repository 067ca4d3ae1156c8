"""The check: the torque right beside wrong, at rest, where the answer is known, and at a state that a student chooses."""

from html import escape

import numpy as np

from cgraph import Graph
from cgraph._shared import Array
from dynamics import formulation_sizes, formulation_verdict, inverse_dynamics
from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, blamed

from ... import theme
from ...graph_drawing.dot import plain_drawing
from ...graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ...pages.document import Picture, Table
from ...pages.formulation_table import TITLES, WHY_FEWER, size_table
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, in_letters, number
from .wrong_way import outputs_after_step

DRAWN = 60  # nodes, at most, of a graph that is drawn
DT = 1e-6  # s, of the check
ALIKE = 1e-4  # of the larger: two numbers that are the same but for dt
ROUNDING = 1e-9  # of the largest torque of the moment: 0


def check(subject: Subject) -> Screen:
    """The screen of a system."""
    right, wrong, terms = inverse_dynamics(subject.system, "chain_rule"), subject.verdict.graph, subject.verdict.terms
    assert terms is not None
    still = {f"{kind}{i}": 0.0 for kind in ("qd", "qdd") for i in range(subject.system.n)}
    held, found = subject.evaluate(right, **still), outputs_after_step(subject, wrong, DT, **still)
    k = int(np.abs(held).argmax())
    name, unit = escape(subject.joints[k]), subject.unit(f"tau{k}")
    rounding = ROUNDING * max(float(np.abs(subject.evaluate(right)).max()), float(np.abs(held).max()))
    needed, given = (0.0 if abs(value) <= rounding else float(value) for value in (held[k], found[k]))
    choices, answer = _choices(needed, given, unit)
    joints = subject.joints[:SHOWN]
    rows = [[joint, number(a), number(b if abs(b) > max(ALIKE * abs(a), rounding) else 0.0)]
            for joint, a, b in zip(joints, held, found, strict=False)]  # fmt: skip
    few = subject.system.n <= 3
    return Screen(
        "check",
        "The check: right beside wrong",
        5,
        "<p>How does one notice? Nothing crashes, and every number is a derivative that was taken without any mistake in "
        f"the calculus. One compares with a case that is known. Here: the system <b>at rest</b>, q̇ = q̈ = 0, in the "
        f"coordinates of this moment. {_at_rest(subject, terms, held, still)} the {subject.force} that holds the system where it "
        f"is. At <b>{name}</b> it is {number(needed)}{unit}{', for nothing pulls there' if not needed else ''}.</p>"
        "<p>The right way to dp/dt needs no step: p depends on q and q̇, which change at the rates q̇ and q̈. So, by the "
        f"{term('chain rule')},</p><p class=\"display\">dp/dt = (∂p/∂q) q̇ + (∂p/∂q̇) q̈,</p><p>"
        "summed over all coordinates, with q and q̇ as separate inputs throughout.</p>",
        f"The graph by definition computes τ at <b>{name}</b>, at rest, with dt = 1e-6 s. It gives …",
        choices,
        answer,
        (
            "<p>By definition dp/dt has ∂L/∂q too much; in τ = dp/dt − ∂L/∂q this cancels the term that holds the "
            "system. A test at rest tells in one line.</p>"
            if needed and not given
            else "<p>Here both agree. Choose another state below.</p>"
            if subject.verdict.differs
            else f"<p>{subject.verdict_text}</p>"
        )
        + Table("Held at rest", [subject.joint, "chain rule", "by definition"], rows).html()
        + _second_try(subject)
        + _sizes(subject),
        f"The verdict of cgraph: {subject.verdict_text}",
        "Choose a state yourself: right beside wrong, and their difference beside ∂L/∂q. Is there a state at which "
        "both agree? Where is the difference the largest? Blue bars: by the chain rule; vermillion: by definition.",
        subject.play(
            "step",
            {"right": right, "wrong": wrong, "terms": terms},
            sliders=subject.sliders(("q", "qd", "qdd") if few else ("q",)),
            joints=joints,
            joint=subject.joint,
            force=subject.force,
            colors=[theme.FORMULATIONS["chain_rule"], theme.FORMULATIONS["by_definition"]],
        ),
    )  # fmt: skip


def _choices(needed: float, given: float, unit: str) -> tuple[tuple[str, ...], int]:
    """Numbers that may be expected, and the place of the one that was measured."""
    if not needed and not given:
        return (f"0{unit}, as the chain rule does", "a number that is not 0"), 0
    values = list(dict.fromkeys([needed, 0.0, 2.0 * needed, -needed]))
    gaps = [abs(given - value) for value in values]
    answer = int(np.argmin(gaps))
    if gaps[answer] > ALIKE * max(abs(needed), abs(given)):
        values, answer = [*values, given], len(values)
    words = {needed: ", as the chain rule does"}
    return tuple([f"{number(value)}{unit}{words.get(value, '')}" for value in values]), answer


def _at_rest(subject: Subject, terms: Graph, held: Array, still: dict[str, float]) -> str:
    """What Lagrange's equation says of rest: that alone where L depends on time or other forces act."""
    pulled = held + subject.evaluate(terms, **still)
    if np.abs(pulled).max() <= ROUNDING * max(float(np.abs(held).max()), np.finfo(float).tiny):
        return "Then p does not change, and Lagrange’s equation leaves τ = −∂L/∂q:"
    return "Then τ is"


def _second_try(subject: Subject) -> str:
    """The kinetic energy alone, which is right where it does not depend on the place."""
    verdict = formulation_verdict(subject.scene, "kinetic_only")
    if verdict.excess_at(subject.values):
        right = subject.evaluate(inverse_dynamics(subject.system, "chain_rule"))
        off = outputs_after_step(subject, verdict.graph, DT) - right
        k = int(np.abs(off).argmax())
        told = (
            f"In the moving moment τ at {escape(subject.joints[k])} is then still off by {number(float(off[k]))}, where the "
            f"right one is {number(float(right[k]))}: K depends on positions as well, and the edge acts on them."
        )
    elif verdict.differs:
        told = "In this moment τ is then right. But K depends on positions, and at other states it is wrong."
    else:
        told = f"Here τ is then right, however small dt is: {in_letters(verdict.reason)}."
    return (
        "<p><b>A second try</b> of the paper keeps the step and takes the kinetic energy K in place of L for the "
        f"momentum, so that the potential energy is reached no more. {in_letters(verdict.taken)} {told} The chain rule "
        "needs neither trick.</p>"
    )


def _sizes(subject: Subject) -> str:
    """The sizes of the graphs, for those who ask."""
    sizes = size_table(formulation_sizes(subject.system)).html()
    why = in_letters(subject.verdict.lacking) or WHY_FEWER.replace("torque", subject.force)
    told = f"<p>{why.replace('spurious', term('spurious'), 1)}</p>" if subject.verdict.differs else ""
    return f"<details><summary>How large the graphs are, and how much of them is there by mistake</summary>{sizes}{told}{_pictures(subject)}</details>"


def _pictures(subject: Subject) -> str:
    """The inertial term by definition and by the chain rule, where they are small enough for a picture."""
    pictures = ""
    for formulation in ("by_definition", "chain_rule"):
        graph, (wrong, edges, _) = blamed(subject.system, INERTIAL_TERM, formulation)
        if len(graph.nodes) > DRAWN:
            return ""
        if not pictures:
            legend = legend_svg(kinds_in(graph, marked=wrong))
            pictures = Picture("", to_adaptive(legend), "The colors of both pictures.", None).html()
        svg = subject.svg(plain_drawing(graph, subject.names, wrong, edges))
        counts = f"{len(wrong)} of {len(graph.nodes)} nodes"
        caption = f"The inertial term, {TITLES[formulation]}: {counts} are there by mistake."
        pictures += Picture("", to_adaptive(svg), caption, None).html()
    return pictures
