"""Lessons: one template for any system, answers that the mechanics gives, a page that stands alone and computes."""

from __future__ import annotations

import json
import math
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.extend import OPS
from tests.chromium import chromium
from tests.tolerances import EQUATIONS
from tests.viz.page_elements import Elements
from viz import cli
from viz.lessons import lesson as module
from viz.lessons.energy_and_step import energy_and_step
from viz.lessons.euler_edge import euler_edge
from viz.lessons.subject import lagrangian_graph, subject_of
from viz.lessons.torque_parts import torque_parts
from viz.pages.operations import graph_data


def free_block() -> dyn.System:
    """Nothing depends on where it is."""
    return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"])


def bead() -> dyn.scenes.Scene:
    """A bead on a rod that turns about a point, by a constraint, pushed as time goes on."""

    def energy(q, qd, t, p):
        return 0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * p["m"] * q[1]

    system = dyn.System(
        energy,
        "x y",
        {"m": 2.0},
        forces=lambda q, qd, t: [cg.sin(t), 0.0],
        damping=0.1,
        constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0},
    )
    return dyn.scenes.Scene("bead", "", system, (0.6, 0.8), (0.0, 0.0), 1.0)


def ball() -> dyn.Mechanism:
    joint = dyn.Joint("ball", name="<b>top</b>")
    return dyn.Mechanism([dyn.Body("top", joint, mass=1.0, center=(0.1, 0.0, -0.5), inertia=(0.1, 0.1, 0.02))])


MODELS = {
    "wheel": lambda: dyn.scenes.load("spring_mass"),
    "arm": lambda: dyn.scenes.load("triple_pendulum"),
    "block": free_block,
    "bead": bead,
    "ball": ball,
}


@pytest.fixture(scope="module", params=[name for name in MODELS if name != "arm"])
def subject(request):
    return subject_of(MODELS[request.param]())


@pytest.fixture(scope="module")
def screens(subject):
    """The screens of that system, {anchor: screen}; of the wheel alone with pictures, which take most of the time."""
    with pytest.MonkeyPatch.context() as patched:
        if subject.system.n > 1 or not subject.system.parameters:
            patched.setattr("viz.lessons.euler_edge.DRAWN", 0)
            patched.setattr("viz.lessons.sweeps.DRAWN", 0)
        return {screen.anchor: screen for screen in [make(subject) for make in module.SCREENS]}


@pytest.fixture(scope="module")
def text(subject, screens) -> str:
    """The page of that system."""
    return module.page(subject, list(screens.values()))


def test_every_lesson_has_the_same_form_and_stands_alone(text):
    found = Elements(text)
    ids = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
    assert (found.open, sorted(set(ids))) == ([], sorted(ids))
    assert text.count('<section class="screen"') == text.count("<summary>Reveal</summary>") == len(module.SCREENS)
    assert "<b>top</b>" not in text
    assert "@media print" in text


def test_the_teacher_s_answers_are_those_of_the_page(text):
    data = json.loads(re.findall(r'<script id="data" type="application/json">(.*?)</script>', text, re.DOTALL)[0])
    listed = re.findall(r"<li><b>\d · [^:]*: ([A-F])\.</b>", text)
    assert ["ABCDEF".index(letter) for letter in listed] == data["answers"]


def test_the_error_by_definition_tends_to_the_slope_of_the_lagrangian(subject, screens):
    """Whether it vanishes is what L says, by differences of L of its own."""
    system = subject.system
    energy = system.graph({"L": system.lagrangian}, system.q, system.qd)
    if system.kinematics.quasi is not None:
        return  # slopes along a quaternion are no differences of L
    at = [subject.evaluate(energy, **{f"q{i}": subject.q[i] + h})[0] for i in range(system.n) for h in (1e-5, -1e-5)]
    slope = np.abs(np.subtract(at[::2], at[1::2])).max() / 2e-5
    screen = screens["euler-edge"]
    assert screen.answer == int(slope > 1e-6)
    if slope > 1e-6:
        (last,) = re.findall(r"largest error is ([−\d.e]+)\.", screen.note)
        assert float(last.replace("−", "-")) == pytest.approx(slope, rel=1e-3)


def test_slopes_of_the_sweeps_are_momenta_under_the_numbers_of_the_listing(subject, screens):
    rows = screens["sweeps"].play["rows"]
    momenta = subject.evaluate(dyn.momentum(subject.system))
    slopes = {row["node"]: row["slope"] for row in rows if row["what"].startswith("p")}
    assert all(slopes[subject.shown(f"qd{i}")] == pytest.approx(p, rel=1e-9, abs=1e-12) for i, p in enumerate(momenta)
               if subject.shown(f"qd{i}") in slopes)  # fmt: skip
    assert slopes
    listing = lagrangian_graph(subject.system).listing()
    operations = [row for row in rows if row["node"][0] == "v" and row["text"]]
    for row in operations[-3:]:
        (line,) = re.findall(rf"^%{row['node'][1:]} = .*$", listing, re.MULTILINE)
        (op,) = re.findall(r"= (\w+)", line)
        assert OPS[op].symbol in row["text"] or op in row["text"]


def test_parts_of_a_torque_add_up(subject, screens):
    screen = screens["why-this-torque"]
    numbers = [
        [float(cell.replace("−", "-")) for cell in re.findall(r"<td>([−\d.e]+)</td>", row)]
        for row in re.findall(r"<tr><td>.*?</tr>", screen.reveal)
    ]
    torque = subject.evaluate(dyn.inverse_dynamics(subject.system, "chain_rule"))
    assert np.allclose([row[-1] for row in numbers], torque, rtol=1e-3, atol=1e-12)
    assert np.allclose([sum(row[:3]) for row in numbers], torque, rtol=2e-3, atol=2e-3 * np.abs(torque).max())


def test_a_pivot_is_the_inertia_with_all_others_free(subject, screens):
    """By the inverse of M: the first joint's acceleration for a unit torque at it."""
    n = subject.system.n
    matrix = subject.evaluate(dyn.mass_matrix(subject.system)).reshape(n, n)
    screen = screens["elimination"]
    free = 1.0 / np.linalg.inv(matrix)[0, 0]
    (told,) = re.findall(r"The pivot is ([\d.e]+)\.", screen.note)
    assert float(told) == pytest.approx(free, rel=1e-3)
    assert screen.answer == int(free < matrix[0, 0] * (1.0 - 1e-9))


def test_a_multiplier_holds_its_row(subject, screens):
    """Pushed by the force that the page tells, the free system moves as if it were held."""
    screen = screens["closed-loop"]
    assert len(set(screen.choices)) == len(screen.choices) >= 2
    if len(subject.system.constraints):
        return
    assert screen.reveal.count("<td>0</td>") >= 1  # of the held joint, without rounding
    n = subject.system.n
    still = {f"qd{i}": 0.0 for i in range(n)}
    force = float(screen.choices[screen.answer].replace("−", "-"))
    forward = dyn.forward_dynamics(subject.system)
    held = subject.evaluate(forward, **still, **{f"tau{n - 1}": force})
    free = subject.evaluate(forward, **still)
    assert abs(held[-1]) <= 1e-3 * max(1.0, abs(free[-1]))


def test_the_answer_on_half_the_step_is_the_factor_that_was_measured(subject, screens):
    """Of a motion for which rk4 is exact there is none, and then none of the factors is right."""
    screen = screens["energy-and-step"]
    factors = [float(text) for text in re.findall(r"a factor of ([\d.]+)\.", screen.reveal)]
    if factors:
        assert abs(math.log2(factors[0] / float(screen.choices[screen.answer]))) < 0.5
    else:
        assert screen.choices[screen.answer] == "none of these"
        assert "rounding" in screen.reveal


def test_a_chain_that_whips_is_watched_for_a_shorter_time():
    """Ten rods are off after a second: the order is measured where it shows, and no warning is left."""
    (factor,) = re.findall(r"a factor of ([\d.]+)\.", energy_and_step(subject_of(dyn.scenes.load("chain", n=6))).reveal)
    assert 12.0 < float(factor) < 24.0


@pytest.fixture(scope="module")
def v8():
    """The page's script for numbers, in a browser's engine."""
    engine = pytest.importorskip("py_mini_racer").MiniRacer()
    engine.eval(module.scripts())
    return engine


def test_the_page_computes_what_the_graphs_do(subject, screens, v8):
    """To the last bits: only functions of the C library may differ in them."""
    plays = [screens[name].play for name in ("euler-edge", "why-this-torque", "elimination", "closed-loop")]
    graphs = [play[name] for play in plays for name in ("right", "wrong", "graph", "free", "held") if name in play]
    assert len(graphs) == 6
    direct = [
        dyn.inverse_dynamics(subject.system, "chain_rule"),
        dyn.inverse_dynamics(subject.system, "by_definition"),
        dyn.inverse_dynamics(subject.system, "chain_rule"),
        dyn.mass_matrix(subject.system),
    ]
    for sent, graph in zip(graphs, direct, strict=False):
        found = json.loads(v8.eval(f"JSON.stringify(named({json.dumps(sent)})({json.dumps(subject.values)}))"))
        expected = subject.evaluate(graph)
        scale = np.abs(expected).max()
        assert np.allclose(list(found.values()), expected, rtol=EQUATIONS, atol=EQUATIONS * scale)


def test_the_page_s_pivots_and_steps_are_the_library_s(v8):
    arm = MODELS["arm"]()
    matrix = subject_of(arm).evaluate(dyn.mass_matrix(arm)).reshape(3, 3)
    stages = json.loads(v8.eval(f"JSON.stringify(stages({matrix.tolist()}))"))
    pivots = [stages[2 - i][i][i] for i in range(3)]
    assert np.prod(pivots) == pytest.approx(np.linalg.det(matrix), rel=EQUATIONS)
    subject = subject_of(arm)
    rate = graph_data(dyn.state_equation(arm.system))
    names = [f"{kind}{i}" for kind in ("q", "qd") for i in range(3)]
    rows = v8.eval(
        f"JSON.stringify(motion(named({json.dumps(rate)}), {json.dumps(subject.values)}, {names}, 0.01, 50, 'rk4'))"
    )
    run = dyn.simulate(arm.system, subject.q, subject.qd, 0.5, "rk4", dt=0.01)
    assert run.stats.success
    assert np.allclose(json.loads(rows)[-1], [*run.q[-1], *run.qd[-1]], rtol=1e-11, atol=1e-11)


def test_a_line_makes_the_page(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("viz.lessons.euler_edge.DRAWN", 0)  # pictures take most of the time
    target = tmp_path / "lesson.html"
    page = viz.lesson(free_block(), target)
    assert target.read_text(encoding="utf-8") == page
    assert cli.main(["lesson", "--out", str(target)]) == 0
    assert "6 screens on spring_mass" in capsys.readouterr().out
    assert "A lesson on spring mass" in target.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match=r"must end in \.html"):
        viz.lesson(free_block(), tmp_path / "lesson.txt")
    with pytest.raises(TypeError, match="first-order"):
        viz.lesson(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]))


def test_a_system_too_large_for_the_page_is_said_to_be(monkeypatch):
    monkeypatch.setattr("viz.lessons.subject.LARGEST_GRAPH", 5)
    assert "too large to be computed" in torque_parts(subject_of(MODELS["wheel"]())).to_html(3)


def test_the_address_holds_the_score(tmp_path):
    """In Chromium where there is one: screens, guesses and the score come from the fragment, and nothing goes wrong."""
    if (program := chromium()) is None:
        pytest.skip("no Chromium here")
    page: Path = tmp_path / "lesson.html"
    viz.lesson(free_block(), page)
    run = subprocess.run(
        [program, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}", "--v=0",
         "--enable-logging=stderr", "--virtual-time-budget=2000", "--dump-dom", f"{page.as_uri()}#4;01-9"],
        capture_output=True, encoding="utf-8", timeout=60, check=False,
    )  # fmt: skip
    assert "CONSOLE" not in run.stderr
    dom = run.stdout
    assert "1 of 2 right" in dom  # A is right on the first, wrong on the second; 9 is no choice
    assert re.findall(r'<section class="screen current" id="([\w-]+)"', dom) == ["elimination"]
    assert dom.count('<details class="reveal" open="">') == 2
    assert re.search(r'<a href="#1"[^>]*class="right"', dom)
    assert re.search(r'<a href="#2"[^>]*class="wrong"', dom)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_what_is_said_of_a_cart_does_not_hang_on_the_order_of_its_coordinates(order: tuple[int, int]) -> None:
    """Its kinetic energy has a cosine of the pendulum's angle in it, and the weight turns the pendulum."""

    def energies(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> cg.Node:
        cart, swing, angle = qd[order[0]], qd[order[1]], q[order[1]]
        kinetic = 1.25 * cart * cart + 0.4 * cart * swing * cg.cos(angle) + 0.16 * swing * swing
        return kinetic + 3.924 * cg.cos(angle)

    names = [("cart", "pendulum")[k] for k in order]
    screen = euler_edge(subject_of(dyn.System(energies, names, damping=[0.4 * (k == 0) for k in order])))
    assert screen.answer == 1
    assert "K contains positions" in screen.reveal
    assert (
        "its energy does change" in energy_and_step(subject_of(dyn.System(energies, names, damping=[0.4, 0.0]))).story
    )


def test_of_what_does_not_depend_on_its_place_the_first_answer_is_right_and_told_so() -> None:
    screen = euler_edge(subject_of(free_block()))
    assert screen.answer == 0
    assert "K does not depend on position" in screen.reveal
    assert "A is right of this system: ∂L/∂q is zero at every state." in screen.note
