"""The live motion in a browser, where Playwright and a Chromium are installed."""

import itertools

import pytest

from tests.each_row import each_row
from viz import cli

SPRING = """import dynamics as dyn
spring = dyn.System(lambda q, qd, t: (qd[0]**2 + 2 * qd[1]**2 - q[0]**2 - q[1]**2) / 2, ["<i>left", "right"])
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The pages, by command."""
    folder = tmp_path_factory.mktemp("pages")
    for command in ("live", "inspect"):
        assert cli.main([command, "triple_pendulum", "--out", str(folder / f"{command}.html")]) == 0
    (folder / "spring.py").write_text(SPRING)
    assert cli.main(["live", f"{folder}/spring.py:spring", "--out", str(folder / "spring.html")]) == 0
    return folder


@pytest.fixture
def show(visit, written):
    """Open a command's page, and wait for what it computes."""

    def opened(command="live", fragment="", height=800, **options):
        page = visit(written / f"{command}.html", fragment, height=height, **options)
        if command == "inspect":
            assert not page.evaluate("'live' in globalThis && 'machine' in live")  # made when its tab is opened
            page.click('#versions button:text-is("live")')
        page.wait_for_selector("#live-panel[data-ready]", state="attached")
        return page

    return opened


def until(page, holds):
    """Wait for it; the page's policy lets no test put its own script in."""
    for _ in range(200):
        if holds():
            return
        page.wait_for_timeout(50)
    raise AssertionError("it did not come")


def meter(page, name):
    return page.locator(f'td[data-meter="{name}"]').inner_text()


def test_a_slider_moves_energy_and_torque_before_the_next_frame(show):
    page = show()
    before = meter(page, "energy"), meter(page, "holding.joint 1")
    moved = page.evaluate(
        """() => new Promise((done) => requestAnimationFrame(() => {
          const slider = document.querySelector('input[aria-label="g, slider"]');
          const read = (name) => document.querySelector(`td[data-meter="${name}"]`).textContent;
          slider.value = 3; slider.dispatchEvent(new Event("input"));
          const texts = ["energy", "holding.joint 1"].map(read);
          requestAnimationFrame(() => done(texts));
        }))"""
    )
    assert moved[1] != before[1]
    page.locator('input[aria-label="q.joint 1"]').fill("0.4")
    assert meter(page, "energy") != before[0]


def test_too_long_a_dt_shows_its_error_and_the_two_arms_part(show):
    page = show()
    assert page.get_attribute("#live-ahead", "data-large") == "false"
    page.locator("#live-dt-field").fill("0.2")
    assert page.get_attribute("#live-ahead", "data-large") == "true"
    page.click("#live-play")
    until(page, lambda: page.get_attribute("#live-since", "data-large") == "true")
    page.click("#live-play")
    assert page.locator(".live-stick").nth(3).get_attribute("d") != page.locator(".live-reference").nth(
        3
    ).get_attribute("d")


def test_a_system_without_places_shows_its_course_before_anything_runs(show):
    """Its coordinates over time by name, and where it is now; what it was set to is the course anew."""
    page = show("spring")
    lines = page.locator("#live-picture .live-course")
    assert lines.count() == 2
    before = [lines.nth(k).get_attribute("d") for k in range(2)]
    assert all(line.count("L") == 300 for line in before)
    assert "q.<i>left" in page.locator("#live-words").inner_text()
    page.get_by_label("q.right", exact=True).fill("2")
    assert lines.nth(0).get_attribute("d") != before[0]  # on the scale of both
    dot = page.locator("#live-picture circle").first
    start = float(dot.get_attribute("cx"))  # on the axis, right of its numbers
    page.click("#live-step")
    assert float(dot.get_attribute("cx")) > start
    numbers = page.locator("#live-picture .live-number").all_text_contents()
    assert sum(each.endswith(" s") for each in numbers) >= 3
    assert sum(not each.endswith(" s") for each in numbers) >= 3
    page.select_option("#live-method", "euler")
    page.fill("#live-dt-field", "1e9")
    for _ in range(40):
        page.click("#live-step")  # until nothing of it is finite: no complaint of a field that takes no NaN
    assert meter(page, "energy") == "—"


def test_a_link_opens_what_was_left_and_reset_forgets_it(show):
    page = show()
    page.locator('input[aria-label="q.joint 2"]').fill("0.123456789012345")
    page.select_option("#live-method", "dopri5")
    for _ in range(3):
        page.click("#live-step")
    page.click("#live-link")
    url, state = page.url, page.evaluate("[...live.machine.run]")
    other = show(fragment=url[url.index("#") :])
    assert other.evaluate("[...live.machine.run]") == state
    assert other.input_value("#live-method") == "dopri5"
    assert other.inner_text("#live-clock") == page.inner_text("#live-clock") != "0.00 s"
    other.click("#live-reset")
    assert other.inner_text("#live-clock") == "0.00 s"
    assert other.evaluate("[...live.machine.run]") == [each["value"] for each in data(other)["inputs"]]


def data(page):
    return page.evaluate("JSON.parse(document.getElementById('live-data').textContent)")


def test_it_is_used_by_keys_alone(show):
    page = show()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "live-play"
    page.keyboard.press("Space")
    until(page, lambda: page.inner_text("#live-clock") > "0.05 s")
    page.keyboard.press("Space")
    assert page.inner_text("#live-play") == "▶ run"
    for _ in range(5):
        page.keyboard.press("Tab")
    before = page.input_value("#live-dt-field")
    page.keyboard.press("ArrowRight")
    assert page.input_value("#live-dt-field") > before


@each_row(("command", "scheme"), itertools.product(("live", "inspect"), ("light", "dark")))
def test_narrow_and_dark_pages_have_all_of_it(command, scheme, show):
    page = show(command, width=390, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    errors = page.locator(".live-errors").bounding_box()
    assert errors["x"] + errors["width"] <= 390
    ink, back = (page.evaluate(f"getComputedStyle(document.body).{each}") for each in ("color", "backgroundColor"))
    assert ink != back
    assert page.locator("#live-picture").bounding_box()["width"] > 300
    assert page.locator(".live-control").count() == len(data(page)["inputs"])


def test_in_the_inspector_it_leaves_the_keys_to_the_page(show):
    page = show("inspect")
    recorded = page.text_content("#clock")
    page.focus("#live-play")
    page.keyboard.press("Space")
    until(page, lambda: page.inner_text("#live-clock") > "0.02 s")
    assert page.text_content("#clock") == recorded
