"""The check: the torque right beside wrong, at rest, where the answer is known, and at a state that a student chooses."""

from __future__ import annotations

import numpy as np

from dynamics import formulation_sizes, formulation_verdict, inverse_dynamics

from ... import theme
from ...pages.document import Table
from ...pages.formulation_table import WHY_FEWER, size_table
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, number
from .wrong_way import after_a_step

DT = 1e-6  # s, of the check
ALIKE = 1e-4  # of the larger: two numbers that are the same but for dt
ROUNDING = 1e-9  # of the largest torque of the moment: 0


def check(subject: Subject) -> Screen:
    """The screen of a system."""
    right, wrong = inverse_dynamics(subject.system, "chain_rule"), subject.verdict.graph
    still = {f"{kind}{i}": 0.0 for kind in ("qd", "qdd") for i in range(subject.system.n)}
    held, found = subject.evaluate(right, **still), after_a_step(subject, wrong, DT, **still)
    k = int(np.abs(held).argmax())
    name, unit = subject.joints[k], subject.unit(f"tau{k}")
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
        f"coordinates of this moment. Then p is zero and stays zero, and Lagrange’s equation leaves τ = −∂L/∂q: the "
        f"{subject.force} that holds the system where it is. At <b>{name}</b> it is {number(needed)}{unit}"
        f"{', for nothing pulls there' if not needed else ''}.</p>"
        "<p>The right way to dp/dt needs no step: p depends on q and q̇, which change at the rates q̇ and q̈. So, by the "
        f"{term('chain rule')},</p><p class=\"display\">dp/dt = (∂p/∂q) q̇ + (∂p/∂q̇) q̈,</p><p>with q and q̇ as "
        "separate inputs throughout.</p>",
        f"The graph by definition computes τ at <b>{name}</b>, at rest, with dt = 1e-6 s. It gives …",
        choices,
        answer,
        (
            "<p>By definition dp/dt has ∂L/∂q too much; in τ = dp/dt − ∂L/∂q this cancels the term that holds the "
            "system. A test at rest tells in one line.</p>"
            if needed and not given
            else "<p>Here both agree. Choose another state below.</p>"
            if subject.verdict.differs
            else f"<p>{subject.verdict.summary}</p>"
        )
        + Table("Held at rest", [subject.joint, "chain rule", "by definition"], rows).html()
        + _second_try(subject)
        + _sizes(subject),
        f"The verdict of cgraph: {subject.verdict.summary}",
        "Choose a state yourself: right beside wrong, and their difference beside ∂L/∂q. Find a state at which both "
        "agree, and one at which the difference is the largest. Blue bars: by the chain rule; vermillion: by definition.",
        subject.play(
            "step",
            {"right": right, "wrong": wrong, **({"terms": subject.verdict.terms} if subject.verdict.terms else {})},
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


def _second_try(subject: Subject) -> str:
    """The kinetic energy alone, which is right where it does not depend on the place."""
    verdict = formulation_verdict(subject.scene, "kinetic_only")
    right = subject.evaluate(inverse_dynamics(subject.system, "chain_rule"))
    off = float(np.abs(after_a_step(subject, verdict.graph, DT) - right).max())
    error, torque = number(off), number(float(np.abs(right).max()))
    if verdict.excess_at(subject.values):
        told = (
            f"In the moving moment τ is then still off by {error}, where the largest is {torque}: "
            "K depends on positions as well, and the edge acts on them."
        )
    elif verdict.differs:
        told = f"In this moment τ is then right, to {error} of {torque}. But K depends on positions, and at other states it is wrong."
    else:
        told = f"Here τ is then right, to {error} of {torque}: K does not depend on positions."
    return (
        "<p><b>A second try</b> of the paper keeps the step and takes the kinetic energy K in place of L for the "
        f"momentum, so that the potential energy is reached no more. {told} The chain rule needs neither trick.</p>"
    )


def _sizes(subject: Subject) -> str:
    """The sizes of the graphs, for those who ask."""
    sizes = size_table(formulation_sizes(subject.system)).html()
    why = f"<p>{subject.verdict.lacking or WHY_FEWER}</p>" * subject.verdict.differs
    return f"<details><summary>How large the graphs are, and how much of them is there by mistake</summary>{sizes}{why}</details>"
