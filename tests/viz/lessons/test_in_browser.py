"""The lesson in Chromium, where it and Playwright are there: keyboard, widths, dark, print, and a silent console."""

from __future__ import annotations

import itertools

import pytest

import dynamics as dyn
import viz
from tests.each_row import each_row


@pytest.fixture(scope="module")
def lesson(tmp_path_factory):
    """A page of the lesson on two links, as a file."""
    path = tmp_path_factory.mktemp("lesson") / "lesson.html"
    viz.lesson(dyn.planar_arm([1.0, 0.8], [1.0, 0.8]), path)
    return path


@pytest.fixture
def show(visit, lesson):
    """Open the page."""
    return lambda fragment="", width=1400, **options: visit(lesson, fragment, width, 900, **options)


def test_keys_are_enough(show):
    page = show()
    for _ in range(6):
        page.keyboard.press("a")
        page.keyboard.press("ArrowRight")
    assert page.inner_text("nav output").endswith("of 6 right")
    page.keyboard.press("b")  # a second guess does not count
    fragment = page.url.partition("#")[2]
    assert fragment == "6;000000"
    again = show(f"#{fragment}")
    assert again.inner_text("nav output") == page.inner_text("nav output")
    page.click("text=Start again")
    assert page.url.endswith("#1;------")
    page.focus("#euler-edge .choice >> nth=1")
    page.keyboard.press("Enter")
    assert page.locator("#euler-edge .reveal[open]").count() == 1


@each_row(("width", "scheme"), itertools.product((390, 1400), ("light", "dark")))
def test_every_screen_fits_and_can_be_read(show, width, scheme):
    page = show(width=width, color_scheme=scheme)
    for k in range(6):
        page.evaluate(f"go({k}); guess({k}, 0)")
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert page.evaluate("[...document.querySelectorAll('.screen')].filter((s) => s.offsetHeight).length") == 1
    light = page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert light == (scheme == "light")


def test_what_one_moves_is_computed(show):
    page = show("#1")
    cells = "[...document.querySelectorAll('#euler-edge .board td')].map((cell) => cell.textContent)"
    before = page.evaluate(cells)
    page.click("text=Let it rest")
    resting = page.evaluate(cells)
    assert resting != before
    assert resting[2] in ("0", "−0")  # by definition the arm weighs nothing
    assert resting[1] not in ("0", "−0")
    page.evaluate("go(3)")
    page.click("text=Take out the next joint")
    assert page.locator("#elimination td.lit").count() == 1
    page.evaluate("go(1)")
    page.click("#sweeps .board button >> nth=0")
    assert page.locator("#sweeps td.lit").count() == 1


def test_print_has_all_questions_and_the_answers(show):
    page = show("#3")
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.evaluate("[...document.querySelectorAll('.screen')].filter((s) => s.offsetHeight).length") == 6
    assert page.evaluate("document.querySelector('.teacher ul').offsetHeight") > 0
    assert page.evaluate("document.querySelector('nav').offsetHeight") == 0
