"""The formulas of a page in a browser: which are seen, of which model, in which color."""

import dynamics as dyn
import viz


def test_the_surplus_is_seen_of_a_wrong_version_alone_and_of_its_model(visit, tmp_path):
    model = dyn.scenes.load("triple_pendulum")
    viz.inspect(model, tmp_path / "arm.html", t_end=0.1)
    page = visit(tmp_path / "arm.html")
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


def test_formulas_scroll_in_their_box_on_a_phone(visit, tmp_path):
    viz.inspect(dyn.scenes.load("triple_pendulum"), tmp_path / "arm.html", t_end=0.1)
    page = visit(tmp_path / "arm.html", width=390, height=844)
    page.evaluate("document.querySelector('#formulas details').open = true")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")
    boxes = page.locator("#formulas .scroll")
    assert boxes.count() == boxes.evaluate_all("all => all.filter((each) => each.tabIndex === 0).length")
