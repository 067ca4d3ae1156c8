"""The built pages in a browser, where Sphinx, Playwright and a Chromium are installed."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import cgraph as cg
from tests.test_docs import ROOT

# Boxes that are cut, or wider than the article, and whether the page itself can be moved sideways. What scrolls inside
# its box has the box's mark; of the elements inside such a box only the box counts.
WIDE = """() => {
  const article = document.querySelector("article"), column = article.getBoundingClientRect();
  const boxes = [...article.querySelectorAll("pre, .table-wrapper, .formula, table, img, .sig")];
  const scrolls = (box) => box.scrollWidth > box.clientWidth + 1;
  const marked = (box) => getComputedStyle(box).backgroundImage.includes("gradient");
  const inside = (box) => box.parentElement.closest(".table-wrapper, .formula");
  const over = boxes.filter((box) => !inside(box) && box.getBoundingClientRect().right > column.right + 1);
  const scrolling = boxes.filter((box) => box.tagName != "TABLE" && scrolls(box) && (WIDTH > 1000 || !marked(box)));
  const sideways = document.scrollingElement.scrollWidth - innerWidth;
  return [...(sideways > 0 ? [sideways] : []), ...[...over, ...scrolling].map((box) => box.outerHTML.slice(0, 200))];
}"""

Visit = Callable[..., Any]
pytestmark = pytest.mark.timeout(600)  # s: the pages are built first


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built with warnings as errors."""
    for package in ("sphinx", "myst_parser", "furo", "latex2mathml"):
        pytest.importorskip(package, reason="the docs extra has it")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "--fail-on-warning", "--keep-going", "-q"]
    built = subprocess.run(
        [*command, str(ROOT / "docs"), str(folder)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> list[Path]:
    return sorted(path for path in site.rglob("*.html") if "_static" not in path.parts)


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (390, "dark")])
def test_nothing_is_wider_than_its_column(visit: Visit, pages: list[Path], width: int, scheme: str) -> None:
    """On a wide page nothing scrolls; on a narrow one a table or formula may, if its box shows it."""
    page, wide = visit(pages[0], "", width, 900, color_scheme=scheme), {}
    for path in pages:
        page.goto(path.as_uri())
        if found := page.evaluate(WIDE.replace("WIDTH", str(width))):
            wide[path.name] = found
    assert wide == {}


WORDS = {
    "floating base": "Mechanisms and joints",
    "animation": "Gallery",
    "LaTeX": "cgraph.latex",
    "export C": "Code from graphs",
}


@pytest.mark.parametrize("words", WORDS)
def test_search_finds(visit: Visit, site: Path, words: str) -> None:
    page = visit(site / "search.html", f"?q={words.replace(' ', '+')}")
    page.wait_for_selector("#search-results li a")
    titles = page.locator("#search-results li a").all_text_contents()[:8]
    assert any(WORDS[words] in title for title in titles), titles


def test_every_page_says_its_version_and_where_changes_and_its_source_are(site: Path, pages: list[Path]) -> None:
    for path in pages:
        page = path.read_text(encoding="utf-8")
        (about,) = re.findall(r'<p class="about">(.*?)</p>', page, re.DOTALL)
        assert f"cgraph {cg.__version__}" in about
        targets = re.findall(r'href="([^"#]+)"', about)
        assert any(target.endswith("changelog.html") for target in targets) or path.name == "changelog.html"
        local = [target for target in targets if "://" not in target]
        assert [target for target in local if not path.parent.joinpath(target).is_file()] == []


def test_no_page_shows_latex(pages: list[Path]) -> None:
    """Formulas are MathML; what is left of LaTeX would stand in the text."""
    formulas = 0
    for path in pages:
        page = path.read_text(encoding="utf-8")
        formulas += page.count("<math")
        assert re.findall(r"<mi>(?:&|&amp;|\\\w*)</mi>", page) == [], path.name  # what the converter does not know
        text = re.sub(r"<pre.*?</pre>|<code.*?</code>|<script.*?</script>", "", page, flags=re.DOTALL)
        assert re.findall(r"\\(?:frac|dot|partial|begin|tau)\b.{0,40}", text) == [], path.name
    assert formulas > 150


def test_the_command_reference_is_built(site: Path) -> None:
    page = (site / "command-reference.html").read_text(encoding="utf-8")
    assert page.count("<h2>cgraph ") > 10
    assert '<span class="pre">--start</span>' in page


def test_the_reference_has_no_docstrings_of_python_s_own(pages: list[Path]) -> None:
    kinds = (dict, tuple, str, Exception, object.__init__, tuple.index)
    own = [line for kind in kinds for line in str(kind.__doc__).split("\n")]
    lines = {" ".join(line.split()) for line in own if len(line) > 12}
    for path in pages:
        if path.parent.name == "reference":
            text = re.sub(r"<[^>]*>", "", path.read_text(encoding="utf-8")).replace("&gt;", ">").replace("’", "'")
            assert [line for line in lines if line in " ".join(text.split())] == [], path.name


def test_a_page_is_at_work_on_the_front_page_and_its_picture_stands_there_without_a_script(
    visit: Visit, site: Path
) -> None:
    page = visit(site / "index.html", "", 1400, 900)
    picture = page.locator(".live-picture img")
    page.locator(".live-frame").scroll_into_view_if_needed()
    live = page.frame_locator(".live-frame")
    live.locator("#live-step").click()
    assert live.locator("#live-clock").text_content().strip().endswith("s")
    assert not picture.is_visible()
    page.emulate_media(media="print")
    assert picture.is_visible()
    assert not page.locator(".live-frame").is_visible()
