"""The typed page in a browser, where Playwright and a Chromium are installed."""

import re

import pytest

import dynamics as dyn
import viz
from tests.each_row import each_row

HOSTILE = "</script><script>alert(1)</script>"


@pytest.fixture
def show(visit, tmp_path):
    def opened(text=None, fragment="", **options):
        path = tmp_path / "page.html"
        path.write_text(viz.typed_page() if text is None else text, encoding="utf-8")
        return visit(path, fragment, **options)

    return opened


def typed(page, text):
    page.fill("#text", text)
    page.locator("#text").press("Control+Enter")


def test_an_own_lagrangian_is_derived_drawn_and_moving(show):
    page = show()
    assert page.locator("#versions button").all_inner_texts() == ["by definition", "kinetic only", "chain rule"]
    typed(page, "m = 1, k = 4\nL = 1/2*m*x'^2 - 1/2*k*x^2\nx(0) = 1")
    graph = dyn.inverse_dynamics(dyn.scenes.load("spring_mass"), "by_definition")  # the same, with other names
    counts = [len(graph.nodes), len(graph.edges), 1, len(dyn.spurious_nodes(graph))]
    found = page.locator("#derived tbody tr").first.inner_text().split()[-4:]
    assert found == [str(counts[i]) for i in (0, 1, 3, 2)]
    assert page.locator("#derived math").all_text_contents() == ["L=0.5·m·x˙2−0.5·k·x2", "τx=m·x¨+k·x"]
    assert 0 < page.locator(".item.wrong").count() <= counts[-1]  # numbers are written where they are used
    page.keyboard.press("Escape")
    page.click("#versions button >> nth=2")
    assert page.locator(".item.wrong").count() == 0
    assert [each[0] for each in page.evaluate("inspector.record().called")][:1] == ["q0"]
    assert page.evaluate("inspector.results()['chain rule'].tau0") == pytest.approx(0.0, abs=1e-12)
    page.select_option("#which", "forward")
    assert page.locator("#versions").is_hidden()
    assert page.evaluate("Object.keys(inspector.results()['forward dynamics'])") == ["qdd0"]
    for name in page.locator("#examples option").all_inner_texts()[1:]:
        page.select_option("#examples", name)
        assert page.locator("#wrong").inner_text() == ""


def test_torques_are_those_of_python(show):
    """A system of a file, its page, and its text typed into the page of another."""
    arm = dyn.planar_arm([1.0, 0.7], [0.9, 0.6])
    page = show(viz.inspect(dyn.scenes.load("spring_mass"), t_end=0.1))
    assert page.locator("#typed").is_hidden()
    assert "L = " in page.input_value("#text")  # that of the page
    page.click("#opentyped")
    typed(page, viz.typed_text(arm))
    at = {"q0": 0.4, "q1": -1.1, "qd0": 0.7, "qd1": 1.9, "qdd0": -2.0, "qdd1": 0.6}
    page.evaluate("(at) => inspector.setState(at)", at)
    expected = dyn.inverse_dynamics(arm, "chain_rule").evaluate(at)
    assert page.evaluate("inspector.results()['chain rule']") == pytest.approx(expected, rel=1e-12)
    live = page.locator('#versions button:text-is("live")')
    assert live.count() == 0  # it moves the page's own model
    page.click("#back-to")
    assert live.count() == 1
    assert page.evaluate("inspector.record().called[0][1]") == "q.theta"
    assert "text=" not in page.url


def test_nonsense_gets_one_sentence_and_the_page_stays(show):
    page = show()
    url, before = page.url, page.evaluate("inspector.record().versions[0].nodes.length")
    for text, words in (("L = m m", "Between “m” and “m”"), (HOSTILE, "not understood"), (f"L = {HOSTILE}", "“<”")):
        typed(page, text)
        sentence = page.locator("#wrong p").inner_text()
        assert words in sentence
        assert "the text before" in page.locator("#wrong small").inner_text()
        assert re.fullmatch(r"Line 1: [^.]+(\.|\?)", sentence)
        assert page.locator("#wrong pre").inner_text().strip() in text
        assert page.locator("#text").get_attribute("aria-invalid") == "true"
        assert page.evaluate("inspector.record().versions[0].nodes.length") == before
        assert page.url == url
    assert page.locator("body script:not([type]) ~ script, img").count() == 0


def test_a_link_holds_the_text(show):
    text = "# 50 % &amp; <b>θ̇</b>\nL = θ̇² + cos(θ)\nθ(0) = 1"
    page = show()
    first = page.evaluate("inspector.record().called")
    typed(page, text)
    link = page.url
    again = show(viz.inspect(dyn.scenes.load("spring_mass"), t_end=0.1), link[link.index("#") :])
    assert again.locator("#typed").is_visible()
    assert again.input_value("#text") == text
    assert again.evaluate("inspector.record().called[0][1]") == "q.θ"
    again.evaluate("location.hash = '#text=L%3Dx%27%5E2&dt=3'")
    again.wait_for_function("document.getElementById('text').value === \"L=x'^2\"")
    assert again.url.endswith("&dt=3")  # what other scripts keep there stays
    again.evaluate("location.hash = '#text=%'")
    again.wait_for_function("document.getElementById('text').value === '%'")
    assert show(fragment="#text=L%3D").evaluate("inspector.record().called") == first  # nothing is to be seen of it


def test_the_keyboard_is_enough(show):
    page = show(viz.inspect(dyn.scenes.load("spring_mass"), t_end=0.1))
    page.locator("#opentyped").focus()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "text"
    page.keyboard.press("Control+a")
    page.keyboard.type("L = x'^2 - 3*x^2, x(0) = 1 u f 1")  # letters that are keys of the page
    page.wait_for_selector("#wrong p")
    for _ in range(5):
        page.keyboard.press("Backspace")
    page.keyboard.press("Backspace")
    page.keyboard.press("Control+Enter")
    assert page.locator("#wrong p").count() == 0
    assert page.evaluate("inspector.record().title") == "Your Lagrangian"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "which"


@each_row("scheme", ["light", "dark"])
def test_a_narrow_page_is_whole(show, scheme):
    page = show(width=390, height=844, color_scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    typed(page, "L = x'^2 - " + "very_long_name_of_something" * 3)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    colors = page.evaluate("(e => [e.color, e.backgroundColor])(getComputedStyle(document.getElementById('text')))")
    light = [sum(map(int, re.findall(r"\d+", color)[:3])) for color in colors]
    assert (light[0] < light[1]) == (scheme == "light")
