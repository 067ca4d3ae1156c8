"""The lesson in Chromium, where it and Playwright are there: keyboard, widths, dark, print, and a silent console."""

import itertools

import pytest

import dynamics as dyn
import viz
from tests.each_row import each_row


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    path = tmp_path_factory.mktemp("lesson") / "lesson.html"
    viz.lesson(dyn.scenes.load("two_link"), path)
    return path


@pytest.fixture
def show(visit, lesson):
    return lambda fragment="", width=1400, **options: visit(lesson, fragment, width, 900, **options)


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lessons")
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    for subject in ("elimination", "loops", "energy", "torque"):
        viz.lesson(arm, folder / f"{subject}.html", subject=subject)
    return folder


def test_keys_are_enough(show):
    page = show()
    page.keyboard.press("a")  # the introduction asks nothing
    for _ in range(5):
        page.keyboard.press("ArrowRight")
        page.keyboard.press("a")
    assert page.inner_text("nav output").endswith("of 5 right")
    page.keyboard.press("b")  # a second guess does not count
    fragment = page.url.partition("#")[2]
    assert fragment == "5;00000"
    again = show(f"#{fragment}")
    assert again.inner_text("nav output") == page.inner_text("nav output")
    other = show("#4;11-9-")  # 9 is no choice
    assert other.inner_text("nav output").endswith("of 2 right")
    assert other.locator(".reveal[open]").count() == other.locator("nav a.right, nav a.wrong").count() == 2
    page.keyboard.press("ArrowRight")
    assert "5 questions" in page.inner_text("#end .score")
    page.click("text=Start again")
    assert page.url.endswith("#0;-----")
    page.keyboard.press("ArrowRight")
    page.focus("#formula-graph .choice >> nth=1")
    page.keyboard.press("Enter")
    assert page.locator("#formula-graph .reveal[open]").count() == 1


def test_a_term_is_explained_where_it_stands(show):
    page = show("#1")
    page.focus("#formula-graph .term >> nth=0")
    page.keyboard.press("Enter")
    assert page.inner_text("#formula-graph .meaning").startswith("computational graph:")
    page.keyboard.press("Enter")
    assert page.locator(".meaning").count() == 0
    assert page.url.endswith("#1;-----")


@each_row(("width", "scheme"), itertools.product((390, 1400), ("light", "dark")))
def test_every_screen_fits_and_can_be_read(show, width, scheme):
    page = show(width=width, color_scheme=scheme, reduced_motion="reduce")
    for k in range(7):
        page.evaluate(f"go({k}); guess(ASKING.indexOf(SCREENS[{k}]), 0)")
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert page.evaluate("[...document.querySelectorAll('.screen')].filter((s) => s.offsetHeight).length") == 1
        scrolling = "[...document.querySelectorAll('.current .scroll')].filter((s) => s.scrollWidth > s.clientWidth)"
        assert page.evaluate(f"{scrolling}.filter((s) => s.tabIndex < 0).length") == 0
    assert page.evaluate("document.getAnimations().length") == 0
    light = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert light == (scheme == "light")


def cells(page, screen):
    """The table of what one plays with."""
    return page.evaluate(f"[...document.querySelectorAll('#{screen} .board td')].map((cell) => cell.textContent)")


def test_what_one_moves_is_computed(show, others, visit):
    page = show("#5")
    before = cells(page, "check")
    page.click("text=Let it rest")
    resting = cells(page, "check")
    assert resting != before
    assert resting[2] == "0"  # by definition nothing holds it
    assert resting[1] == resting[4].replace("−", "")  # and by the chain rule what does is -dL/dq
    page.evaluate("go(3)")
    assert cells(page, "euler-edge")[1] == page.evaluate("digits(LESSON.values.q0_old)")  # dt is 0
    page.evaluate("go(2)")
    for _ in range(2):
        page.click("#sweeps .board button >> nth=0")
    assert page.locator("#sweeps td.lit").count() == page.locator("#sweeps .graph-picture .lit").count() == 1
    lit = "document.querySelector('#sweeps td.lit').parentElement.rowIndex"
    low = page.evaluate(lit)
    page.click("#sweeps .board button >> nth=0")
    assert page.evaluate(lit) < low  # values go up, as in the picture
    page.click("text=All values >> visible=true")
    page.click("#sweeps .board button >> nth=0")
    assert page.evaluate(lit) == 1  # slopes begin at L and go down
    page = visit(others / "elimination.html", "#1", 1400, 900)
    page.click("text=Take out the next")
    assert page.locator("#elimination td.lit").count() == 1
    page = visit(others / "energy.html", "#1", 1400, 900)
    assert page.locator("#energy-and-step .board svg text").count() == 6  # E with its unit, three values, 0 and t


def test_print_has_all_questions_and_the_glossary(show):
    page = show("#3")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate("[...document.querySelectorAll('.screen')].filter((s) => s.offsetHeight).length") == 6
    assert page.evaluate("document.querySelector('#glossary dl').offsetHeight") > 0
    assert page.evaluate("document.querySelector('nav').offsetHeight") == 0
    assert page.evaluate("document.querySelector('.reveal').offsetHeight") == 0
