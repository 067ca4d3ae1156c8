"""What axe-core says of every kind of page, where it and a Chromium are installed: nothing serious."""

from functools import cache
from importlib.resources import files
from typing import Any

import pytest

import dynamics as dyn
import viz
from viz.pages.document import Document, Paragraph, Picture, Section, Table, to_html

pytest.importorskip("axe_playwright_python", reason="the browser extra has it")

ARM = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
HINGE = dyn.Joint("revolute", axis=(0, 1, 0), position=(0.0, 0.0, -0.2))
LOWER, UPPER = "lower_arm of the lift", "right_upper_arm right_shoulder_1"  # in two lines
LIFT = dyn.Mechanism(
    [dyn.Body(LOWER, HINGE, mass=1.0, center=(0, 0, -0.1)), dyn.Body(UPPER, HINGE, LOWER, 1.0, (0, 0, -0.1))]
)
WIDE = Table("Sizes", ["", *[f"a long column {k}" for k in range(9)]], [["row", *["1"] * 9]])
PLOT = '<svg xmlns="http://www.w3.org/2000/svg" width="900" height="300"/>'
DOCUMENT = Document("d", [Paragraph("p")], [Section("s", "S", [WIDE, Picture("p", PLOT, "a caption")])])
PAGES = {
    "inspector": lambda: viz.inspect(ARM, t_end=0.2),
    "long names": lambda: viz.inspect(LIFT, t_end=0.1),
    "live": lambda: viz.live(ARM),
    "typed": viz.typed_page,
    "lesson": lambda: viz.lesson(ARM),
    "document": lambda: to_html(DOCUMENT),
}
# That a name has the words that are seen is a rule that is off unless asked for.
RUN = """axe.run(document, { resultTypes: ["violations"], rules: { "label-content-name-mismatch": { enabled: true } } })
  .then((found) => found.violations.filter(({ impact }) => ["serious", "critical"].includes(impact))
  .map(({ id, nodes }) => [id, nodes.map(({ html }) => html)]))"""


@cache
def axe() -> str:
    return files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")


def said(page: Any) -> list[Any]:
    page.evaluate(f"{axe()}; 0")
    return page.evaluate(RUN)


@pytest.mark.parametrize("kind", PAGES)
def test_axe_finds_nothing_serious(visit, tmp_path, kind):
    (tmp_path / "page.html").write_text(PAGES[kind](), encoding="utf-8")
    for width, scheme in ((1400, "light"), (390, "dark")):
        page = visit(tmp_path / "page.html", width=width, height=900, color_scheme=scheme)
        assert said(page) == []
        assert "…" not in "".join(page.locator("#scene text").all_text_contents())
        if kind == "long names" and width == 390:
            assert page.locator(".body .label").first.locator("tspan").count() == 2
    if kind == "inspector":
        for name in ("forward dynamics", "live"):
            page.locator("#versions button", has_text=name).click()
            page.wait_for_timeout(100)
            assert said(page) == []
