"""The figure that moves, in Chromium, where it and Playwright are there: views, steps, keys, and a silent console."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from dynamics import Mechanism, Rows
from tests.each_row import each_row
from viz.paper.free_fall import figures4_and_5
from viz.paper.one_joint import equations, figures_1_to_3
from viz.paper.paper import page_of
from viz.paper.reconfiguration import FIRST, figure10, module


@pytest.fixture(scope="module")
def article(tmp_path_factory):
    """The page, of Equation (3) and of Figures 1 to 5 and 10 alone."""
    path = tmp_path_factory.mktemp("article") / "index.html"
    path.write_text(page_of([equations(), figures_1_to_3(), figures4_and_5(), figure10((2, 3))], {}))
    return path


def test_views_share_one_layout_and_keys_reach_every_node(visit, article):
    page = visit(article, "", 1400, 900)
    place = "document.querySelector('[data-place=\"qdd0\"]').getBoundingClientRect().x"
    seen = "[...document.querySelectorAll('.stage .box')].filter((box) => !box.classList.contains('off')).length"
    before = page.evaluate(place)
    assert page.evaluate(seen) == 22
    page.check("text=Figure 3: chain rule")
    assert (page.evaluate(place), page.evaluate(seen)) == (before, 7)
    assert page.inner_text("#caption").startswith("Figure 3. The chain rule")
    page.keyboard.press("Tab")
    told = set()
    for _ in range(7):
        told.add(page.inner_text("#told b"))
        page.keyboard.press("ArrowRight")
    assert told == {"I", "ω", "I ω", "α", "I α", "p = ∂L/∂ω = I ω", "dp/dt = I α"}


def test_a_smaller_step_leaves_the_error(visit, article):
    page = visit(article, "", 1400, 900)
    cells = "[...document.querySelectorAll('#compared td:last-child')].map((cell) => cell.textContent)"
    page.focus("#dt")
    page.keyboard.press("Home")
    assert page.evaluate(cells) == ["−16.5", "0", "0"]
    page.hover('[data-place="mul(dt, qdd0)"]')
    assert page.inner_text("#told").startswith("α dt = 4")
    page.keyboard.press("End")
    assert page.evaluate(cells) == ["−1.5", "0", "0"]
    assert page.inner_text("#told").startswith("α dt = 4e−6")


def test_the_fall_begins_by_its_button_and_stops(visit, article):
    page = visit(article, "", 390, 900, reduced_motion="reduce")
    page.wait_for_timeout(100)
    assert page.evaluate("byId('time').value") == "60"  # nothing moves by itself
    page.click("text=Let it fall")
    for _ in range(50):
        page.wait_for_timeout(100)
        if page.evaluate("byId('time').value") != "60":
            break
    page.click("text=Stop")
    stopped = page.evaluate("byId('time').value")
    assert page.inner_text("#run") == "Go on"
    assert page.locator("#arm line").count() == 3
    page.focus("#time")
    page.keyboard.press("End")
    assert (page.inner_text("#time + output"), page.inner_text("#run")) == ("3.00 s", "Let it fall")
    assert 0 <= int(stopped) < 150


def test_modules_hang_where_they_are_dragged_and_their_torques_are_those_of_rows(visit, article):
    page = visit(article, "", 1400, 900)
    bodies, q = [], [angle for _, angle in FIRST]
    for kind, _ in FIRST:
        bodies.append(module(kind, *bodies[-1:]))

    def holds():
        told = [
            float(each) for each in page.locator("#rows data").evaluate_all("(all) => all.map((each) => each.value)")
        ]
        expected = Rows(Mechanism(bodies)).inverse(q, 0.0 * np.array(q), 0.0 * np.array(q))
        assert page.inner_text("#counted").startswith(f"{len(bodies)} rows, one kernel")
        return told == pytest.approx(expected, rel=0.0, abs=1e-12)

    def drag(what, x, y):
        what.hover()
        page.mouse.down()
        page.mouse.move(x, y, steps=5)
        page.mouse.up()

    assert holds()
    page.locator("#assembly").scroll_into_view_if_needed()
    elbow = page.locator("#bodies g circle").nth(1).bounding_box()  # the end of the first module
    drag(page.get_by_text("twist, 1.5 kg"), elbow["x"] + 8, elbow["y"] + 8)
    bodies, q = [*bodies, module("twist", bodies[0]), *bodies[5:]], [*q, 0.0]
    bodies[4] = replace(bodies[4], name="branch")
    assert holds()
    drag(page.locator("#bodies g line[class=link2]"), 200, 800)  # the load, off
    bodies, q = [*bodies[:3], bodies[4]], [*q[:3], 0.0]
    assert holds()
    page.get_by_text("bend, 2 kg").press("Enter")
    bodies, q = [*bodies, module("bend", bodies[-1])], [*q, 0.0]
    page.get_by_label("angle of bend").last.press("ArrowRight")
    q[-1] = 0.01
    assert holds()
    page.get_by_label("take off twist").first.press("Enter")  # and all that it carries
    bodies, q = [bodies[0], *bodies[3:]], [q[0], *q[3:]]
    assert holds()


@each_row(("width", "scheme"), itertools.product((390, 1400), ("light", "dark")))
def test_the_page_fits_and_texts_can_be_read(visit, article, width, scheme):
    page = visit(article, "", width, 900, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    heights = "[...document.querySelectorAll('.stage svg text')].map((text) => text.getBoundingClientRect().height)"
    assert min(page.evaluate(heights)) > 9.0


def test_paper_has_every_figure_by_itself(visit, article):
    page = visit(article, "", 1400, 900)
    page.emulate_media(media="print")
    figures = page.locator("#figures figure").filter(visible=True)
    assert [text[:8] for text in figures.all_inner_texts()] == ["Shapes, ", "Figure 1", "Figure 2", "Figure 3"]
