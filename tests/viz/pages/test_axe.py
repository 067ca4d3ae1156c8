"""What axe-core says of every kind of page, where it and a Chromium are installed: nothing serious."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

import pytest

import dynamics as dyn
import viz
from viz.pages.document import Document, Paragraph, Picture, Section, Table, to_html

pytest.importorskip("axe_playwright_python", reason="the browser extra has it")

ARM = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
WIDE = Table("Sizes", ["", *[f"a long column {k}" for k in range(9)]], [["row", *["1"] * 9]])
PLOT = '<svg xmlns="http://www.w3.org/2000/svg" width="900" height="300"/>'
DOCUMENT = Document("d", [Paragraph("p")], [Section("s", "S", [WIDE, Picture("p", PLOT, "a caption")])])
PAGES = {
    "inspector": lambda: viz.inspect(ARM, t_end=0.2),
    "live": lambda: viz.live(ARM),
    "typed": viz.typed_page,
    "lesson": lambda: viz.lesson(ARM),
    "document": lambda: to_html(DOCUMENT),
}
RUN = """axe.run(document, { resultTypes: ["violations"] }).then((found) => found.violations
  .filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => [id, nodes.map(({ html }) => html)]))"""  # noqa: E501 (a program)


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
    if kind == "inspector":
        for name in ("forward dynamics", "live"):
            page.locator("#versions button", has_text=name).click()
            page.wait_for_timeout(100)
            assert said(page) == []
