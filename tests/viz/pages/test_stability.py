"""The page of the stability table: verdicts, figures and reasons, on one page and as files."""

import json
from pathlib import Path
from typing import Any

import pytest

from viz import cli
from viz.pages import stability_page
from viz.pages.document import Document, to_html

pytest.importorskip("matplotlib")


def figure(value: float | str, meets: bool, bound: float | str = 1.0) -> dict[str, Any]:
    why = "a reason of the bound"
    return {"quantity": "error", "value": value, "bound": bound, "unit": "ulp", "why": why, "meets": meets}


def row(case: str, verdict: str, *figures: dict[str, Any], reason: str = "", stopped: str = "") -> dict[str, Any]:
    run = {"steps": 12, "rejected": 3, "seconds": 0.25, "stopped": stopped}
    about = f"what is hard about {case}"
    shared = {"section": "Cases", "case": case, "about": about, "method": "radau", "verdict": verdict, "reason": reason}
    return {**shared, **run, "measurements": list(figures)}


ROWS = [
    row("Robertson", "meets", figure(1e-9, True), figure(0.5, True, "inf")),
    row("a name that is longer than there is room for", "limit", figure(7.0, False), reason="A known <reason>."),
    row("another", "limit", figure(8.0, False), reason="A known <reason>."),
    row("broken", "unexplained", figure("nan", False), stopped="stopped at t = 1 s"),
]
CONTENT = {
    "machine": "a processor",
    "load": 0.5,
    "date": "2025-01-01",
    "seconds": 12.0,
    "quick": False,
    "sections": [
        {"name": "Cases", "about": "What the figures are.", "rows": ROWS},
        {"name": "Empty", "about": "Nothing.", "rows": []},
    ],
}


@pytest.fixture(scope="module")
def document() -> Document:
    return stability_page.document(CONTENT)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are empty, where only words and tables are looked at."""
    monkeypatch.setattr(stability_page, "shares", lambda rows: None)
    monkeypatch.setattr(stability_page, "to_adaptive_svg", lambda figure: "<svg/>")


def test_the_page_counts_verdicts_and_gives_every_reason_once(document: Document) -> None:
    page = to_html(document)
    assert "1 of 4 rows meet their bounds; limits with a known reason: 2; unexplained: 1." in page
    assert page.count("A known &lt;reason&gt;.") == 1
    assert "Unexplained. stopped at t = 1 s" in page
    assert "Empty" not in page


def test_a_line_is_a_figure_and_a_long_name_stays_in_one() -> None:
    (line,) = stability_page._lines(ROWS[1])
    assert line[0] == ROWS[1]["case"]
    first, second = stability_page._lines(ROWS[0])
    assert first == ["Robertson", "radau", "meets", "error [ulp]", "1.0e-09", "1", "12 + 3", "0.25"]
    assert second == ["", "", "", "error [ulp]", "0.5", "", "", ""]
    assert stability_page._lines(ROWS[3])[0][4] == "nan ✗"


def test_success_does_not_stand_in_the_box_of_a_warning(document: Document, undrawn: None) -> None:
    right = {**CONTENT, "sections": [{"name": "Cases", "about": "", "rows": ROWS[:3]}]}
    assert 'class="warning"' not in to_html(stability_page.document(right))
    assert '<p class="warning">1 of 4 rows' in to_html(document)


def test_what_is_beyond_its_bound_is_drawn_in_the_color_of_what_is_wrong() -> None:
    axis = stability_page.shares(ROWS).axes[0]
    met, missed = (line for line in axis.lines if line.get_marker() in ("o", "X"))
    assert list(met.get_xdata()) == [1e-9]
    assert list(missed.get_xdata()) == [7.0, 8.0, stability_page.TO]
    assert missed.get_color() == stability_page.theme.SPURIOUS
    assert [label.get_text() for label in axis.get_yticklabels()] == [each["case"] for each in ROWS]


def test_the_command_writes_the_table_and_fails_for_an_unexplained_row(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, undrawn: None
) -> None:
    """Two cases in place of all, one by a method that does not suit it."""
    from dynamics.experiments.stability import case_runs

    def two(quick: bool) -> Any:
        assert quick
        yield from case_runs.results(["exponential decay"], ("dopri5",))
        yield from case_runs.results(["Kapitza's pendulum"], methods)

    monkeypatch.setattr("dynamics.experiments.stability.stability.results", two)
    methods = ("dopri5",)
    assert cli.main(["report", "--stability", "--quick", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert "2 rows: 2 meets, 0 limit, 0 unexplained" in printed.out
    assert "cgraph: meets       exponential decay, dopri5" in printed.err
    assert len((tmp_path / "stability.csv").read_text(encoding="utf-8").splitlines()) == 3
    methods = ("euler",)
    assert cli.main(["report", "--stability", "--quick", "--json", "--out", str(tmp_path)]) == 1
    printed = capsys.readouterr()
    assert json.loads(printed.out)["sections"][0]["rows"][1]["verdict"] == "unexplained"
    assert "beyond its bound without a known reason: Kapitza's pendulum by euler" in printed.err
