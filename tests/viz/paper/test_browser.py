"""The figure that moves, in Chromium, where it and Playwright are there: views, steps, keys, and a silent console."""

import itertools

import pytest

from tests.each_row import each_row
from viz.paper.free_fall import figures4_and_5
from viz.paper.one_joint import equations, figures_1_to_3
from viz.paper.paper import page_of


@pytest.fixture(scope="module")
def article(tmp_path_factory):
    """The page, of Equation (3) and of Figures 1 to 5 alone."""
    path = tmp_path_factory.mktemp("article") / "index.html"
    path.write_text(page_of([equations(), figures_1_to_3(), figures4_and_5()], {}))
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
