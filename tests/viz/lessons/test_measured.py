"""All systems, all questions: the marked answer is measured, and no sentence speaks of what a system has not."""

import math
import re
from functools import cache, partial
from html import unescape

import numpy as np
import pytest

import dynamics as dyn
from tests.each_row import each_row
from tests.viz.lessons.systems import SYSTEMS
from viz.lessons.introduction import introduction
from viz.lessons.lesson import LESSONS
from viz.lessons.screen import Screen
from viz.lessons.subject import Subject, lagrangian_graph, subject_of

MAKERS = list(dict.fromkeys([screen for each in LESSONS.values() for screen in each.screens]))
MODELS = {name: partial(dyn.scenes.load, name) for name in dyn.scenes.names()} | SYSTEMS
SMALL = [name for name in MODELS if name != "chain"]
ROWS = [*SMALL, pytest.param("chain", marks=pytest.mark.slow)]  # its ten joints take seconds
SLOPE = 1e-5  # of differences


@cache
def lesson(name: str) -> tuple[Subject, dict[str, Screen]]:
    """A system and its screens, by their anchors, without pictures, which take most of the time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("viz.lessons.subject.render_svg", lambda source: "<svg></svg>")
        subject = subject_of(MODELS[name]())
        return subject, {screen.anchor: screen for screen in [make(subject) for make in MAKERS]}


def still(subject: Subject, *kinds: str) -> dict[str, float]:
    """Zeros in place of velocities or accelerations."""
    return {f"{kind}{i}": 0.0 for kind in kinds for i in range(subject.system.n)}


def slopes(subject: Subject, **other: float) -> np.ndarray:
    """dL by a way of every velocity, by differences of L."""
    system = subject.system
    energy = system.graph({"L": system.lagrangian}, system.q, system.qd)
    found = []
    for k in range(system.n):
        ways = dyn.state_equation(system).evaluate(
            {name: subject.values[name] for name in dyn.state_equation(system).input_names}
            | still(subject, "qd")
            | {f"qd{k}": 1.0}
        )
        ends = [
            subject.evaluate(
                energy, **other, **{f"q{i}": subject.q[i] + h * float(ways[f"q{i}_dot"]) for i in range(system.nq)}
            )[0]
            for h in (SLOPE, -SLOPE)
        ]
        found.append((ends[0] - ends[1]) / (2.0 * SLOPE))
    return np.array(found)


def joint(subject: Subject, screen: Screen) -> int:
    """The one that the question is about."""
    (name,) = re.findall(r"<b>(.*?)</b>", screen.question)
    return subject.joints.index(unescape(name))


def formula_graph(subject: Subject, screen: Screen) -> bool:
    name = f"q{subject.system.nq - 1}"
    ends = [
        subject.evaluate(lagrangian_graph(subject.system), **{name: subject.values[name] + h})[0] for h in (0.0, 0.1)
    ]
    return screen.answer == int(math.isclose(*ends, rel_tol=1e-12))


def sweeps(subject: Subject, screen: Screen) -> bool:
    """One sweep has made every slope of the table: each is a difference of L."""
    assert screen.play
    graph = lagrangian_graph(subject.system)
    inputs = {subject.shown(name): name for name in graph.input_names}
    for row in screen.play["rows"]:
        if row["node"] in inputs:
            name = inputs[row["node"]]
            ends = [subject.evaluate(graph, **{name: subject.values[name] + h})[0] for h in (SLOPE, -SLOPE)]
            assert row["slope"] == pytest.approx((ends[0] - ends[1]) / (2.0 * SLOPE), rel=1e-5, abs=1e-7)
    return screen.choices[screen.answer] == "1"


def euler_edge(subject: Subject, screen: Screen) -> bool:
    """The coordinate after the step, from its rate alone."""
    names = {f"<b>{subject.told(name)}</b>": name for name in subject.values}
    pushed, moved = (names[text] for text in re.findall(r"<b>.*?</b>", screen.question))
    rate = dyn.state_equation(subject.system)
    at = {name: subject.values[name] for name in rate.input_names}
    at |= {f"q{i}": subject.values[f"q{i}_old"] for i in range(subject.system.nq)}
    ends = [float(rate.evaluate(at | {pushed: at[pushed] + push})[f"{moved}_dot"]) for push in (0.0, 1.0)]
    told = float(re.findall(r"by ([−\d.e]+)", screen.choices[screen.answer])[0].replace("−", "-"))
    return told == pytest.approx(1e-3 * (ends[1] - ends[0]), rel=1e-3)


def wrong_way(subject: Subject, screen: Screen) -> bool:
    """The error tends to the slope of L; where that is 0, the error at a second says whether there is any."""
    k = joint(subject, screen)
    if abs(slopes(subject)[k]) > 1e-6:
        return screen.choices[screen.answer] == "It tends to a number that is not zero"
    (first,) = re.findall(r"<tr><td>1</td>(?:<td>([−\d.e]+)</td>)", screen.reveal)
    return screen.choices[screen.answer] == ("There is no error, at any dt" if first == "0" else "It vanishes with dt")


def check(subject: Subject, screen: Screen) -> bool:
    """By definition at rest: the torque of the chain rule and the slope of L, by differences."""
    k = joint(subject, screen)
    right = subject.evaluate(dyn.inverse_dynamics(subject.system, "chain_rule"), **still(subject, "qd", "qdd"))
    expected = right[k] + slopes(subject, **still(subject, "qd"))[k]
    told = float(re.findall(r"^[−\d.e]+", screen.choices[screen.answer])[0].replace("−", "-"))
    return told == pytest.approx(expected, rel=1e-3, abs=1e-6 * max(1.0, abs(right[k])))


def forward_sweep(subject: Subject, screen: Screen) -> bool:
    """At the top of the sweep stands dp/dt."""
    assert screen.play
    rates = {row["node"]: row["rate"] for row in screen.play["rows"]}
    for i, rate in enumerate(subject.evaluate(dyn.momentum_rate(subject.system))):
        assert rates.get(subject.shown(f"p{i}"), rate) == pytest.approx(rate, rel=1e-9, abs=1e-9)
    swept, written = (len(dyn.inverse_dynamics(subject.system, f"chain_rule{end}").nodes) for end in ("", "_literal"))
    return screen.choices[screen.answer] == ("fewer" if swept < written else "more" if swept > written else "as many")


def torque_parts(subject: Subject, screen: Screen) -> bool:
    """By the mass matrix, and by what is left at rest."""
    k, n = joint(subject, screen), subject.system.n
    torque = dyn.inverse_dynamics(subject.system)
    inertia = subject.evaluate(dyn.mass_matrix(subject.system)).reshape(n, n) @ subject.qdd
    position = subject.evaluate(torque, **still(subject, "qd", "qdd"))
    parts = inertia, subject.evaluate(torque) - inertia - position, position
    return screen.answer == int(np.argmax([abs(part[k]) for part in parts]))


def elimination(subject: Subject, screen: Screen) -> bool:
    """By the inverse of M: what a unit of torque does with all others free."""
    n = subject.system.n
    matrix = subject.evaluate(dyn.mass_matrix(subject.system)).reshape(n, n)
    free = 1.0 / np.linalg.inv(matrix)[0, 0]
    (told,) = re.findall(r"The pivot is ([\d.e]+)\.", screen.note)
    assert float(told) == pytest.approx(free, rel=1e-3)
    return screen.choices[screen.answer] == ("Smaller" if free < matrix[0, 0] * (1.0 - 1e-9) else "As large")


def closed_loop(subject: Subject, screen: Screen) -> bool:
    """Pushed by the force that is marked, the free system moves as if it were held."""
    system, n = subject.system, subject.system.n
    assert len(set(screen.choices)) == len(screen.choices) >= 2
    force = float(screen.choices[screen.answer].split()[0].replace("−", "-"))
    way = 2.0 * subject.q if len(system.constraints) else np.eye(n)[-1]  # J, of x^2 + y^2 - 1
    push = {f"tau{i}": force * float(way[i]) for i in range(n)}
    free = dyn.forward_dynamics(system.without_constraints)
    held = subject.evaluate(free, **still(subject, "qd"), **push)
    loose = subject.evaluate(free, **still(subject, "qd"))
    return abs(way @ held) <= 2e-3 * max(float(np.abs(loose).max()), 1e-9)


def energy_and_step(subject: Subject, screen: Screen) -> bool:
    """The factor of the errors beside a motion by 24 times as many steps."""
    steps, t_end = re.findall(r"takes (\d+) steps to t = ([\d.e−]+) s", screen.question)[0]
    end = float(t_end.replace("−", "-"))
    ends = [
        dyn.simulate(subject.system, subject.q, subject.qd, end, "rk4", dt=end / (factor * int(steps))).q[-1]
        for factor in (1, 2, 24)
    ]
    errors = [float(np.abs(each - ends[2]).max()) for each in ends[:2]]
    if screen.choices[screen.answer] == "none of these factors":
        return errors[1] < 1e-12 or min(abs(math.log2(errors[0] / errors[1]) - power) for power in (1, 2, 4)) > 0.4
    return abs(math.log2(errors[0] / errors[1]) - math.log2(float(screen.choices[screen.answer]))) < 0.6


MEASURES = {"why-this-torque": torque_parts} | {
    each.__name__.replace("_", "-"): each
    for each in (
        formula_graph,
        sweeps,
        euler_edge,
        wrong_way,
        check,
        forward_sweep,
        elimination,
        closed_loop,
        energy_and_step,
    )
}


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")  # that an error is large is what is looked for
@each_row("name", ROWS)
def test_every_marked_answer_is_the_measured_one(name):
    subject, screens = lesson(name)
    assert {*screens} == {*MEASURES}
    assert [anchor for anchor, screen in screens.items() if not MEASURES[anchor](subject, screen)] == []
    assert [anchor for anchor, screen in screens.items() if len({*screen.choices}) < len(screen.choices)] == []


def told(screen: Screen) -> str:
    """All words of a screen."""
    parts = (screen.story, screen.question, *screen.choices, screen.reveal, screen.note, screen.play_words)
    return re.sub(r"<[^>]*>", " ", re.sub(r'"data:[^"]*"', "", " ".join(parts)))


@each_row("name", ROWS)
def test_no_sentence_speaks_of_what_a_system_has_not(name):
    subject, screens = lesson(name)
    words = " ".join([told(screen) for screen in screens.values()])
    absent = [r"(?<!two-link )\barms?\b", r"\bweighs?\b", r"\bmotors?\b", r"\bnan\b", r"\binf\b"]
    if not subject.units:
        absent += [r"\bjoints?\b(?! \d)", r"\btorques?\b(?! of the chain rule)", r"\brad\b", r"\bN m\b", r"\blinks?\b"]
    if subject.system.n == 1:
        absent += [r"\bothers\b", r"\bother (joint|coordinate|mass|velocit)", r"\bjoint after\b"]
    found = {pattern: re.findall(f".{{0,30}}{pattern}.{{0,20}}", words) for pattern in absent}
    assert {pattern: texts for pattern, texts in found.items() if texts} == {}
    assert not [
        choice for screen in screens.values() for choice in screen.choices if re.search(r"e−1\d", choice)
    ]  # rounding


@each_row("name", SMALL)
def test_every_system_and_every_screen_is_told_with_numbers_of_one_moment(name):
    subject, screens = lesson(name)
    start = introduction(subject)
    assert "nan" not in start
    for screen in screens.values():
        assert screen.to_html(1).count('class="choice"') == len(screen.choices)
        letter = "ABCDEF"[screen.answer]
        assert f'<p class="answer"><b>{letter}.</b> {screen.choices[screen.answer]}.</p>' in screen.to_html(1)
        assert f"<b>{letter}.</b>" in screen.paper_html(1, key=True)
        assert f"<b>{letter}.</b>" not in screen.paper_html(1, key=False)
    assert ("<b>top</b>" in "".join([screen.to_html(1) for screen in screens.values()])) is False


def test_minutes_are_those_of_the_screens():
    _, screens = lesson("two_link")
    by_maker = dict(zip(MAKERS, screens.values(), strict=True))
    for each in LESSONS.values():
        assert each.minutes == 3 + sum([by_maker[maker].minutes for maker in each.screens])
