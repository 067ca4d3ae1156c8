"""The views of one page in a browser: tabs, the address that says what is seen, robots of many limbs, formulas."""

import re
from itertools import groupby
from operator import itemgetter

import pytest

import dynamics as dyn
import viz
from tests.each_row import each_row

SELECTED = '#versions [aria-selected="true"]'


def quadruped() -> dyn.Mechanism:
    bodies = [dyn.Body("trunk", dyn.Joint("free"), mass=9.0, inertia=(0.1, 0.2, 0.25))]
    for end, x in (("front", 0.2), ("hind", -0.2)):
        for side, y in (("left", 0.1), ("right", -0.1)):
            parent, at = "trunk", (x, y, 0.0)
            for part, axis in (("hip", (1, 0, 0)), ("thigh", (0, 1, 0)), ("calf", (0, 1, 0))):
                hinge = dyn.Joint("revolute", axis=axis, position=at)
                name = f"{end}_{side}_{part}"
                bodies.append(dyn.Body(name, hinge, parent, 0.7, (0.0, 0.0, -0.1), (0.01, 0.01, 0.004)))
                parent, at = name, (0.0, 0.0, -0.2)
    return dyn.Mechanism(bodies)


def arm_of_seven() -> dyn.Mechanism:
    bodies, parent = [], "world"
    for k in range(7):
        hinge = dyn.Joint("revolute", axis=((0, 0, 1), (0, 1, 0))[k % 2], position=(0.0, 0.0, 0.2 if k else 0.0))
        bodies.append(dyn.Body(f"panda_link{k + 1}", hinge, parent, 3.0 - 0.3 * k, (0, 0.02, 0.1), (0.03, 0.03, 0.01)))
        parent = bodies[-1].name
    return dyn.Mechanism(bodies)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    spiral = dyn.OdeSystem(lambda y, t: [y[1], -y[0] - 0.2 * y[1]], ["x", "v"])
    arm = dyn.scenes.load("triple_pendulum")
    models = {"arm": arm, "quadruped": quadruped(), "seven": arm_of_seven(), "ode": spiral}
    for name, model in models.items():
        viz.inspect(model, folder / f"{name}.html", start=[1.0, 0.0] if name == "ode" else None, t_end=0.5)
    return folder


@pytest.fixture
def show(visit, written):
    return lambda name="arm", fragment="", **options: visit(written / f"{name}.html", fragment, **options)


def tab(page, name):
    page.locator("#versions button", has_text=name).first.click()


def test_every_view_is_a_tab_of_one_page_in_one_state(show):
    page = show()
    names = ["by definition", "kinetic only", "chain rule", "Newton-Euler smallest", "forward dynamics",
             "Hamilton's equations", "state equation", "live"]  # fmt: skip
    assert page.locator("#versions [role=tab]").all_text_contents() == names
    page.evaluate("inspector.setState({ q0: 0.3, qd1: -0.7 })")
    state = page.evaluate("inspector.state()")
    arm = dyn.scenes.load("triple_pendulum")
    momenta = dyn.momentum(arm).evaluate({name: state[name] for name in dyn.momentum(arm).input_names})
    assert {name: state[name] for name in momenta} == pytest.approx(momenta)
    found = page.evaluate("inspector.results()")
    graph = dyn.hamilton_equations(arm)
    rates = graph.evaluate({name: state[name] for name in graph.input_names})
    assert found["Hamilton's equations"] == pytest.approx(rates)
    for i, name in enumerate(names[:-1]):
        page.keyboard.press(f"{i + 1}")
        assert page.inner_text(SELECTED) == name
        assert page.locator("#results td").first.is_visible()
        assert page.locator(".item").count() > 5
    page.keyboard.press("8")
    page.wait_for_selector("#live-panel[data-ready]")
    assert not page.locator("#picture").is_visible()


def test_a_version_stands_beside_those_that_answer_the_same_question(show):
    page = show()
    for name, columns in (("chain rule", 4), ("forward", 1), ("Hamilton", 2)):
        tab(page, name)
        assert page.locator("#results thead th").count() == columns


def test_a_question_is_kept_from_view_to_view(show):
    """q.joint 3 is a node inside of one graph, and an input of the others."""
    page = show()
    page.locator('[aria-label="what to explain"]').select_option(label="tau.joint 2")
    page.locator('[aria-label="by what it depends on"]').select_option(label="by q.joint 3")
    slopes, told = [], re.compile(r"^∂tau.joint 2 by q.joint 3 is (\S+) N m per rad", re.MULTILINE)
    for name in ("by definition", "chain rule", "Newton-Euler"):
        tab(page, name)
        slopes.append(told.search(page.inner_text("#why"))[1])
        if name == "by definition":  # what is left of it without the mistake and the step is what the others say
            corrected = re.search(r"vanishes with dt: (\S+) N m per rad", page.inner_text("#why"))[1]
    assert slopes[0] != slopes[1] == slopes[2] == corrected
    tab(page, "Hamilton")
    assert "Choose an output" in page.inner_text("#why")  # it has no torque


def test_back_goes_back_over_views_choices_and_folds(show):
    page = show()
    first = page.url
    tab(page, "chain rule")
    page.locator(".item.box").first.click()
    page.locator("#otau1").click()
    assert page.locator(".frame").count() == 1
    assert re.search(r"#view=chain_rule&pick=\d+&fold=", page.url)
    page.go_back()
    assert page.locator(".item.picked").count() == 0
    assert page.locator(".frame").count() == 1
    page.go_back()
    assert page.locator(".frame").count() == 0
    assert page.inner_text(SELECTED) == "chain rule"
    page.go_back()
    assert page.inner_text(SELECTED) == "by definition"
    assert page.url == first
    page.go_forward()
    assert page.inner_text(SELECTED) == "chain rule"


def test_a_link_opens_what_was_seen(show):
    page = show()
    tab(page, "forward")
    page.keyboard.press("f")
    page.evaluate("(s) => { s.value = 9; s.oninput(); }", page.query_selector("#time"))
    page.evaluate("inspector.setState({ q1: 0.123456789012345, tau0: -2 })")
    page.locator("#oqdd1").click()
    page.click("#copylink")
    other = show(fragment=page.url[page.url.index("#") :])
    seen = "[document.querySelector('[aria-selected=true]').textContent, inspector.state(), inspector.results()]"
    assert other.evaluate(seen) == page.evaluate(seen)
    for what in ("#picture .item", "#picture .picked", "#picture .body"):
        assert other.locator(what).count() == page.locator(what).count()
    assert other.inner_text("#clock") == page.inner_text("#clock")
    other.click("#reset")
    assert other.evaluate("inspector.state().tau0") == 0


NOTHING = ("#view=none", "#pick=%", "#fold=~", "#fold=9.x~99~", "#at=q0:x,zz:1", "#time=1e9", "#&&=", "#view=%")


def test_a_link_that_says_nothing_leaves_the_page_as_it_is(show):
    page = show(fragment=NOTHING[0])
    q = page.evaluate("inspector.state().q0")
    for fragment in NOTHING:
        page.evaluate("(hash) => { location.hash = hash; }", fragment)
        page.wait_for_timeout(30)
        assert page.inner_text(SELECTED) == "by definition"
        assert page.locator(".item").count() > 5
        assert page.evaluate("inspector.state().q0") == q


@each_row("name", ["quadruped", "seven", "arm"])
def test_no_result_is_cut(show, name):
    page = show(name, width=1400, height=900)
    cut = "[...document.querySelectorAll('#results .scroll')].map((e) => e.scrollWidth > e.clientWidth)"
    for each in ("by definition", "forward", "Hamilton"):
        tab(page, each)
        assert page.evaluate(cut) == [False]


BOXES = """() => [...document.querySelectorAll(".item.body")]
  .map((each) => [each.querySelector("rect").getBBox().y, each.querySelector("title").textContent])"""


def test_limbs_are_rows_and_the_coarsest_level_is_a_phones(show):
    page = show("quadruped", width=1400, height=900)
    boxes = page.evaluate(BOXES)
    rows = [[name for _, name in group] for _, group in groupby(sorted(boxes, key=itemgetter(0)), key=itemgetter(0))]
    assert ["trunk", "front_left_hip", "front_left_thigh", "front_left_calf"] in rows
    assert ["hind_right_hip", "hind_right_thigh", "hind_right_calf"] in rows
    phone = show("quadruped", width=390, height=844)
    assert phone.locator(".item.body").count() == 15
    assert phone.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")


SIZES = """() => { const k = document.getElementById("scene").getCTM().a;
  return [...document.querySelectorAll("#scene text")]
    .filter((e) => e.textContent && getComputedStyle(e).display !== "none")
    .map((e) => k * parseFloat(getComputedStyle(e).fontSize)); }"""


@each_row(("name", "width"), [("arm", 1400), ("quadruped", 1400), ("quadruped", 390), ("seven", 390)])
def test_no_text_in_the_picture_is_smaller_than_nine_pixels(show, name, width):
    page = show(name, width=width, height=844)
    for keys in ("", "u", "u", "-", "-", "-", "-"):
        if keys:
            page.keyboard.press(keys)
        sizes = page.evaluate(SIZES)
        assert min(sizes, default=9.0) >= 8.99
    page.keyboard.press("0")
    assert any(page.evaluate(SIZES))  # names of columns stay


def test_what_is_unfolded_can_be_read(show):
    page = show("seven", width=1400, height=900)
    page.keyboard.press("u")
    page.locator(".item.box").last.click()
    assert page.evaluate("document.getElementById('scene').getCTM().a") * 13 >= 10.9


def test_the_outline_has_every_node_of_the_graph_as_text(show):
    page = show("ode")
    page.click("#outline > summary")
    graph = dyn.OdeSystem(lambda y, t: [y[1], -y[0] - 0.2 * y[1]], ["x", "v"])
    page.wait_for_selector("#outlined details")
    closed = page.locator("#outlined details:not([open]) > summary").locator("visible=true")
    while closed.count():
        closed.first.click()
        page.wait_for_timeout(20)
    drawn = [node for node in dyn.state_equation(graph).nodes if node.value is None]
    texts = page.locator("#outlined button").all_text_contents()
    assert len(set(texts)) >= len(drawn)
    page.locator("#outlined button").nth(2).click()
    assert page.locator(".item.picked").count() > 0


def test_with_reduced_motion_the_motion_is_shown_in_few_steps(show):
    page = show(reduced_motion="reduce")
    page.evaluate("window.told = 0; inspector.onState(() => { told += 1; }); 0")
    page.click("#play")
    page.wait_for_timeout(450)
    assert page.evaluate("told") <= 3


def test_paper_has_the_inputs_in_a_line_and_the_wide_tables_whole(show):
    page = show("quadruped", color_scheme="dark", width=1400)
    page.evaluate("inspector.setState({ qd0: 0.25 }); dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert "qd.trunk.vx = 0.25 m/s" in page.inner_text("#printed")
    assert page.locator("#wide table").is_visible()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    page.emulate_media(media="screen")
    assert not page.locator("#printed").is_visible()


def test_the_surplus_is_seen_of_a_wrong_version_alone_and_of_its_model(show):
    """Among the formulas of the page."""
    page = show()
    formulas, short = page.locator("#formulas"), page.locator("#formulas summary math")
    surplus = formulas.locator(".first")
    assert short.is_visible()
    assert short.text_content() == "τdef−τ=∂L∂q"
    page.click("#formulas summary")
    assert surplus.locator("mtable.aligned > mtr").count() == 3
    wrong = page.evaluate("getComputedStyle(document.querySelector('#formulas .first math')).color")
    page.keyboard.press("3")
    assert not surplus.is_visible()
    assert not short.is_visible()
    titles = page.locator("#formulas h3:visible").all_inner_texts()
    assert titles == ["Lagrangian", "Momenta, p = ∂L/∂q̇", "Torque by matrices", "Spurious term, kinetic only"]
    assert wrong != page.evaluate(
        "getComputedStyle(document.querySelector('#formulas .equations:not(.spurious) math')).color"
    )
    assert "Indices: 1 is joint 1, 2 is joint 2, 3 is joint 3." in formulas.inner_text()
    page.click("#opentyped")
    page.fill("#text", "L = 1/2*x'^2 - 1/2*x^2, x(0) = 1")
    page.locator("#text").press("Control+Enter")
    assert not formulas.is_visible()  # the typed one has its own
    page.click("#back-to")
    assert formulas.is_visible()


def test_formulas_scroll_in_their_box_on_a_phone(show):
    page = show(width=390, height=844)
    page.evaluate("document.querySelector('#formulas details').open = true")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")
    boxes = page.locator("#formulas .scroll")
    assert boxes.count() == boxes.evaluate_all("all => all.filter((each) => each.tabIndex === 0).length")
