"""Lessons: one template for any system, a page that stands alone and computes, a worksheet and its key."""

import html
import json
import re
from pathlib import Path

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
import viz
from cgraph.extend import OPS
from dynamics.integrators import TABLEAUS
from dynamics.scenes.scenes import of_model
from tests.each_row import each_row
from tests.tolerances import EQUATIONS
from tests.viz.lessons.systems import SYSTEMS, block
from tests.viz.page_elements import Elements, data_of
from viz import cli
from viz.lessons import lesson as module
from viz.lessons.screen import Screen
from viz.lessons.screens.check import check
from viz.lessons.screens.closed_loop import closed_loop
from viz.lessons.screens.elimination import elimination
from viz.lessons.screens.energy_and_step import energy_and_step
from viz.lessons.screens.sweeps import backward_sweep
from viz.lessons.screens.torque_parts import torque_parts
from viz.lessons.screens.wrong_way import wrong_way
from viz.lessons.subject import lagrangian_graph, subject_of
from viz.models.equations import model_equations
from viz.models.equations_text import equations_latex
from viz.pages.operations import expression


@pytest.fixture(autouse=True)
def undrawn(request, monkeypatch):
    """No pictures, which take most of the time, but where they are asked for."""
    if "picture" in request.node.name:
        return
    monkeypatch.setattr("viz.lessons.subject.render_svg", lambda source: "<svg></svg>")


def made(name: str, form: str = "page", **options: str) -> str:
    model = SYSTEMS[name]() if name in SYSTEMS else dyn.scenes.load(name)
    return viz.lesson(model, form=form, **options)


@each_row(("form", "name"), [("page", "two_link"), ("worksheet", "hoop"), ("key", "ball")])
def test_every_lesson_has_the_same_form_and_stands_alone(form, name):
    text = made(name, form, title="<i>Mine</i>", author="A & B")
    found = Elements(text)
    ids = [attributes["id"] for _, attributes in found.elements if "id" in attributes]
    assert (found.open, sorted(set(ids))) == ([], sorted(ids))
    assert "&lt;i&gt;Mine&lt;/i&gt;" in text
    assert "A &amp; B" in text
    assert "<b>top</b>" not in text
    assert "@media print" in text
    links = {
        str(attributes["href"])[1:] for kind, attributes in found.elements if kind == "a" and "class" in attributes
    }
    assert form == "key" or (links and links <= {*ids})  # every term is in the glossary
    if form == "page":
        assert text.count('class="predict"') == text.count("<summary>Reveal</summary>") == 5
        assert [text.count(f"--subject {subject} ") for subject in module.LESSONS] == [0, 1, 1, 1, 1, 1]


def test_a_worksheet_asks_and_its_key_answers():
    sheet, key = made("hoop", "worksheet"), made("hoop", "key")
    for text in (sheet, key):
        assert text.count('<ul class="choices">') == 5
    assert sheet.count('class="because"') == 5
    assert re.findall(r"<span>(\w+)</span>", sheet)[:3] == ["Name", "Class", "Date"]
    assert sheet.count("<b>Mark.</b>") == 3  # values, slopes, and the edges of the step
    assert 'class="answer"' not in sheet
    assert key.count('class="answer"') == 5
    formulas = equations_latex(model_equations(of_model(SYSTEMS["hoop"]())), 40)
    assert html.escape(formulas) in key


def test_the_pictures_of_a_key_have_the_marks():
    sheet, key = made("two_link", "worksheet"), made("two_link", "key")
    pictures = [re.findall(r"data:image/svg\+xml;base64,([^\"]*)", text) for text in (sheet, key)]
    assert [each == other for each, other in zip(*pictures, strict=True)] == [False] * 3


def test_the_guesses_are_scored_by_the_marked_answers():
    text = made("block")
    listed = re.findall(r'<p class="answer"><b>([A-F])\.</b>', text)
    assert ["ABCDEF".index(letter) for letter in listed] == data_of(text)["answers"]


@each_row("name", SYSTEMS)
def test_no_letter_is_always_right(name):
    for chosen in ("euler", "sweeps"):
        screens = [
            Screen(str(k), "", 1, "", "", ("one", "two", "three"), 0, "", "")
            for k in range(len(module.LESSONS[chosen].screens))
        ]
        answers = [screen.answer for screen in module.arranged(screens, f"{chosen} {name}")]
        assert len({*answers}) > 1
        assert answers == [screen.answer for screen in module.arranged(screens, f"{chosen} {name}")]
    sizes = Screen("", "", 1, "", "", ("12 N", "−3 N", "0 N", "none of these"), 1, "", "").arranged(name)
    assert (list(sizes.choices), sizes.answer) == (["−3 N", "0 N", "12 N", "none of these"], 0)


def test_the_second_try_keeps_its_sign():
    subject = subject_of(SYSTEMS["orbit"]())
    (off, right) = re.findall(r"still off by ([−\d.e]+), where the right one is ([−\d.e]*\d)", check(subject).reveal)[0]
    torque, excess = (float(each.replace("−", "-")) for each in (right, off))
    assert torque == pytest.approx(subject.evaluate(dyn.inverse_dynamics(subject.system, "chain_rule"))[0], rel=1e-3)
    verdict = dyn.formulation_verdict(subject.scene, "kinetic_only")
    assert excess == pytest.approx(verdict.excess_at(subject.values)["tau0"], rel=1e-2)


@each_row("name", ["two_link", "ball", "hoop"])
def test_rows_of_the_sweeps_stand_under_the_numbers_of_the_listing(name):
    subject = subject_of(SYSTEMS[name]() if name in SYSTEMS else dyn.scenes.load(name))
    rows = backward_sweep(subject).play["rows"]
    assert rows[-1]["node"] == "L"
    listing = lagrangian_graph(subject.system).listing()
    for row in [row for row in rows if row["node"][0] == "v" and row["text"]][-3:]:
        (line,) = re.findall(rf"^%{row['node'][1:]} = .*$", listing, re.MULTILINE)
        (op,) = re.findall(r"= (\w+)", line)
        assert OPS[op].symbol in row["text"] or op in row["text"] or (op == "pow" and "power" in row["text"])


def test_a_chain_that_whips_is_watched_for_a_shorter_time():
    """Ten rods are off after a second: the order is measured where it shows, and no warning is left."""
    (factor,) = re.findall(
        r"a factor of ([\d.]+)\. The", energy_and_step(subject_of(dyn.scenes.load("chain", n=6))).reveal
    )
    assert 12.0 < float(factor) < 24.0


@pytest.fixture(scope="module")
def v8():
    engine = pytest.importorskip("py_mini_racer").MiniRacer()
    engine.eval(module.scripts())
    return engine


@each_row("name", ["two_link", "ball", "bead"])
def test_the_page_computes_what_the_graphs_do(name, v8):
    """To the last bits: only functions of the C library may differ in them."""
    subject = subject_of(SYSTEMS[name]() if name in SYSTEMS else dyn.scenes.load(name))
    plays = [screen(subject).play for screen in (check, torque_parts, elimination, closed_loop)]
    graphs = [
        f"Object.values({play['modules']})[{k}]" for play in plays for k in range(play["modules"].count("(() =>"))
    ]
    assert len(graphs) == 7
    direct = [
        dyn.inverse_dynamics(subject.system, "chain_rule"),
        dyn.inverse_dynamics(subject.system, "by_definition"),
        subject.verdict.terms,
        dyn.inverse_dynamics(subject.system, "chain_rule"),
        dyn.mass_matrix(subject.system),
    ]
    for sent, graph in zip(graphs, direct, strict=False):
        found = json.loads(v8.eval(f"JSON.stringify(named({sent})({json.dumps(subject.values)}))"))
        expected = subject.evaluate(graph)
        scale = np.abs(expected).max()
        assert np.allclose(list(found.values()), expected, rtol=EQUATIONS, atol=EQUATIONS * scale)


def test_the_page_s_pivots_and_steps_are_the_library_s(v8):
    arm = dyn.scenes.load("triple_pendulum")
    matrix = subject_of(arm).evaluate(dyn.mass_matrix(arm)).reshape(3, 3)
    stages = json.loads(v8.eval(f"JSON.stringify(stages({matrix.tolist()}))"))
    pivots = [stages[2 - i][i][i] for i in range(3)]
    assert np.prod(pivots) == pytest.approx(np.linalg.det(matrix), rel=EQUATIONS)
    subject = subject_of(arm)
    rate = expression(cg.to_js(dyn.state_equation(arm.system), TABLEAUS))
    rows = v8.eval(f"JSON.stringify(motion({rate}, {json.dumps(subject.values)}, 0.01, 50, 'rk4'))")
    run = dyn.simulate(arm.system, subject.q, subject.qd, 0.5, "rk4", dt=0.01)
    assert run.stats.success
    assert np.allclose(json.loads(rows)[-1][:6], [*run.q[-1], *run.qd[-1]], rtol=1e-11, atol=1e-11)


def test_a_line_makes_the_pages(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = viz.lesson(block(), "lesson.html")
    assert Path("lesson.html").read_text(encoding="utf-8") == page
    line = "lesson --out a.html --worksheet b.html --key c.html --subject loops --author Me"
    assert cli.main(line.split()) == 0
    assert re.findall(r"^(.*?): (1 question|work|ans)", capsys.readouterr().out, re.MULTILINE) == [
        ("a.html", "1 question"), ("b.html", "work"), ("c.html", "ans"),
    ]  # fmt: skip
    for name in ("a.html", "b.html", "c.html"):
        assert "A constraint and its force" in Path(name).read_text(encoding="utf-8")
    for wrong, message in (
        (["lesson", "--key", "a.txt"], "--key must end"),
        (["lesson", "--out", "a.html", "--key", "a.html"], "different files"),
        (["lesson", "--out", "a.html", "--subject", "euclid"], "subject must be"),
    ):  # fmt: skip
        assert cli.main(wrong) == cli.ERROR
        assert message in capsys.readouterr().err
    with pytest.raises(ValueError, match=r"must end in \.html"):
        viz.lesson(block(), tmp_path / "lesson.txt")
    with pytest.raises(TypeError, match="first-order"):
        viz.lesson(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]))


def test_a_system_too_large_for_the_page_is_said_to_be(monkeypatch):
    monkeypatch.setattr("viz.lessons.subject.LARGEST_GRAPH", 5)
    assert "too large to be computed" in torque_parts(subject_of(dyn.scenes.load("spring_mass"))).to_html(3)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_what_is_said_of_a_cart_does_not_hang_on_the_order_of_its_coordinates(order: tuple[int, int]) -> None:
    """Its kinetic energy has a cosine of the pendulum's angle in it, and the weight turns the pendulum."""

    def energies(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> cg.Node:
        cart, swing, angle = qd[order[0]], qd[order[1]], q[order[1]]
        kinetic = 1.25 * cart * cart + 0.4 * cart * swing * cg.cos(angle) + 0.16 * swing * swing
        return kinetic + 3.924 * cg.cos(angle)

    names = [("cart", "pendulum")[k] for k in order]
    subject = subject_of(dyn.System(energies, names, damping=[0.4 * (k == 0) for k in order]))
    screen = wrong_way(subject)
    assert screen.choices[screen.answer] == "It tends to a number that is not zero"
    assert "<b>pendulum</b>" in screen.question
    assert "K depends on positions" in check(subject).reveal
    assert "its energy does change" in energy_and_step(subject).story


def test_of_what_does_not_depend_on_its_place_it_is_said_that_there_is_no_error() -> None:
    subject = subject_of(block())
    screen = wrong_way(subject)
    assert screen.choices[screen.answer] == "There is no error, at any dt"
    assert "∂L/∂q is 0, and the derivative through" in screen.reveal
    assert "∂K/∂q is 0" in check(subject).reveal
    assert "happens to be right" in made("block")
