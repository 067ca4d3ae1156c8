"""The wrong way: the slope of L by a velocity takes a second path, and what is left of it as dt tends to 0."""

from html import escape

import numpy as np

from cgraph import Graph
from cgraph._shared import Array
from dynamics import inverse_dynamics, momentum, momentum_rate

from ...pages.document import Table
from ...pages.mathml import equations
from ..glossary import term
from ..screen import Screen
from ..subject import SHOWN, Subject, number

STEPS = (1.0, 0.1, 0.01, 1e-3, 1e-6)  # s
ROUNDING = 1e-9  # of the largest torque: an error at the shortest step that says nothing, for 1 / dt is in it
VANISHES, STAYS, GROWS, NONE = range(4)


def wrong_way(subject: Subject) -> Screen:
    """The screen of a system."""
    right = inverse_dynamics(subject.system, "chain_rule")
    torque = subject.evaluate(right)
    errors = [(dt, outputs_after_step(subject, subject.verdict.graph, dt) - torque) for dt in STEPS]
    answer = _answer(subject, errors, torque)
    k = subject.watched
    name = escape(subject.joints[k])
    return Screen(
        "wrong-way",
        "The derivative goes the wrong way",
        6,
        f"<p>The momentum p = ∂L/∂q̇ is the slope of L by a velocity. {term('by definition', 'By definition')}, as the "
        "paper calls it, this slope is taken in the graph with the step: a "
        f"{term('backward sweep')} starts at L with 1. Part of it reaches q̇ directly. Another part reaches q first, goes "
        "on along the edge of the Euler relation, and is multiplied by dt there. Both add up:</p>"
        '<p class="display">p by definition = <b>∂L/∂q̇ + dt · ∂L/∂q</b></p>'
        + _momenta(subject)
        + f"<p>The second part is small, since dt is. Then, to get the {term('inertial term')} dp/dt, p is differentiated "
        "with respect to dt, the time that passes in this graph.</p>",
        f"We shrink dt from one second to a millionth of a second. The error is dp/dt by definition less the right one. "
        f"What does it do at <b>{name}</b>?",
        (
            "It vanishes with dt",
            "It tends to a number that is not zero",
            "It grows beyond all bounds",
            "There is no error, at any dt",
        ),
        answer,
        _reveal(subject, answer, errors),
        f"At dt = 1e-6 s the error at {name} is {number(float(errors[-1][1][k]))}{subject.unit(f'tau{k}')}. "
        + (
            "Expect hands for “It vanishes with dt”: a smaller step cures almost every other error of a simulation."
            if answer == STAYS
            else "Ask for a system for which it tends to a number that is not zero: one with a weight or a spring."
        ),
    )


def outputs_after_step(subject: Subject, wrong: Graph, dt: float, **other: float) -> Array:
    """Outputs of an embedded graph at the same state after a step dt.  other: another state than the subject's."""
    values = subject.values | other
    before = {}
    for name, value in subject.values.items():
        if name.endswith("_old"):
            now = name.removesuffix("_old")
            rate = (subject.values[now] - value) / subject.values["dt"] if not other else 0.0
            before[name] = values[now] - rate * dt
    return subject.evaluate(wrong, **other, dt=dt, **before)


def _answer(subject: Subject, errors: list[tuple[float, Array]], torque: Array) -> int:
    """What the errors do, measured at the watched joint."""
    sizes = [abs(float(error[subject.watched])) for _, error in errors]
    rounding = ROUNDING * float(np.abs([torque, *[error for _, error in errors]]).max())
    if max(sizes) <= rounding:
        return NONE
    if sizes[-1] <= max(rounding, 10.0 * STEPS[-1] * max(sizes)):
        return VANISHES
    return GROWS if sizes[-1] > 10.0 * sizes[-2] else STAYS


def _momenta(subject: Subject) -> str:
    """p by the graph of L, the slope dL/dq, and p by definition at the subject's dt."""
    right = subject.evaluate(momentum(subject.system))
    graph = momentum_rate(subject.system, "by_definition", keep_momentum=True)
    wrong = subject.evaluate(Graph(graph.inputs, {f"p{i}": graph.outputs[f"p{i}"] for i in range(subject.system.n)}))
    rows = [
        [joint, *map(number, numbers)]
        for joint, *numbers in zip(subject.joints[:SHOWN], right, subject.slopes, wrong, strict=False)
    ]
    header = [subject.joint, "p = ∂L/∂q̇", "∂L/∂q", "p by definition"]
    return Table(f"At dt = {subject.values['dt']:g} s, in this moment", header, rows).html()


def _reveal(subject: Subject, answer: int, errors: list[tuple[float, Array]]) -> str:
    joints, k = subject.joints[:SHOWN], subject.watched
    rows = [[f"{dt:g}".replace("e-0", "e-"), *[number(error) for error in each[: len(joints)]]] for dt, each in errors]
    unit = subject.unit(f"tau{k}").strip()
    steps = Table(f"Error of dp/dt by definition{unit and f' [{unit}]'}", ["dt [s]", *joints], rows).html()
    if answer == NONE:
        return f"<p>{subject.verdict_text}</p>{steps}"
    law = (
        "<p>The derivative of dt · ∂L/∂q with respect to dt is ∂L/∂q + dt · (…), by the product rule. The second part "
        "vanishes with dt. The first does not have dt in it any more: by definition, dp/dt tends to dp/dt + <b>∂L/∂q</b>. "
    )
    if answer == VANISHES:
        elsewhere = "Where it is not zero, the error stays." if subject.verdict.differs else subject.verdict_text
        return f"{law}Here ∂L/∂q is zero in this moment, and so nothing of it is seen. {elsewhere}</p>{steps}"
    terms = subject.verdict.terms
    assert terms is not None
    name = f"tau{k}"
    shown = equations(
        Graph(terms.inputs, {name: terms.outputs[name]}), {**subject.names, name: f"∂L/∂q.{subject.joints[k]}"}
    )
    return (
        f"{law}At {escape(subject.joints[k])} the term that is too much is</p>{shown}<p>which is <b>{number(subject.slopes[k])}"
        f"{subject.unit(name)}</b> in this moment, the last line of the table.</p>{steps}"
    )
