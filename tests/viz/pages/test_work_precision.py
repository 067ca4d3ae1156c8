"""Reports of integrators as pages: what was measured is shown, and a mistake costs a line."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from viz import cli
from viz.pages.document import Table, to_html

pytest.importorskip("matplotlib")


from dynamics import METHODS
from viz import theme
from viz.pages.work_precision_page import _line, work_precision
from viz.plots.direct_labels import labeled


def point(knob: float, seconds: float, error: float | None, **others: Any) -> dict[str, Any]:
    row = {"knob": knob, "step": 0.1 * knob, "seconds": seconds, "median": 1.5 * seconds, "steps": 10}
    row |= {"rejected": None, "evaluations": 40, "error": error, "largest": error, "drift": error}
    return row | others


def curve(name: str, kind: str, points: list[dict[str, Any]], **others: Any) -> dict[str, Any]:
    row = {"name": name, "kind": kind, "order": 4, "fitted": 3.987}
    return row | {"stopped": "rounding", "points": points} | others


def content(**others: Any) -> dict[str, Any]:
    """The plain data of a report."""
    tolerances = [10.0**-k for k in range(3, 12)]
    steps = [64.0 * 2**k for k in range(8)]
    curves = [
        curve("rk4", "equal steps", [point(n, 1e-6 * n, 1e3 * n**-4) for n in steps]),
        curve("dop853", "chosen steps", [point(r, 1e-4 * r**-0.1, 0.5 * r) for r in tolerances]),
    ]
    return {
        "name": "an arm <3>",
        "about": "an arm",
        "states": 6,
        "t_end": 10.0,
        "nodes": 190,
        "conservative": True,
        "stiff": False,
        "relative_to": "largest",
        "times": [0.0, 5.0, 10.0],
        "reference": "Taylor series",
        "reference_error": 1e-34,
        "machine": "a machine",
        "load": [1.0, None],
        "curves": curves,
        "absent": {"euler": "too slow"},
        "left_out": ["contacts"],
        "targets": [{"error": 1e-6, "name": "dop853", "knob": 1e-6, "seconds": 4e-4}],
    } | others


def shown(page: str) -> str:
    """The text of a page."""
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", re.sub(r"<style>.*?</style>", "", page, flags=re.DOTALL)))


@pytest.fixture(scope="module")
def page() -> str:
    """The page, one picture of panels drawn for all of them: drawing takes seconds."""
    kept: list[Any] = []

    def once(panels: Any, **options: Any) -> Any:
        kept.extend([] if kept else [labeled(panels, **options)])
        return kept[0]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("viz.pages.work_precision_page.labeled", once)
        return to_html(work_precision(content()))


def test_the_page_says_what_was_measured(page: str) -> None:
    for words in (
        "Error and run time: an arm &lt;3&gt;",
        "It was made by: Taylor series. Its own error is 1.0e-34.",
        "a machine",
        "Left out of the model: contacts.",
        "400 µs dop853",
        "3.99",
        "euler too slow",
    ):
        assert words in shown(page).replace("A machine", "a machine"), words


def test_a_method_has_one_color_on_every_page() -> None:
    """Whatever else is on the page, and no two of ours look alike."""
    assert set(theme.METHODS) == set(METHODS)
    looks = [_line({"name": name, "points": []}, "error", "seconds").color for name in theme.METHODS]
    assert len({(number % 5, number // 5) for number in looks}) == len(METHODS)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are empty, where only words and tables are looked at: drawing takes seconds."""
    monkeypatch.setattr("viz.pages.work_precision_page.labeled", lambda *_, **__: None)
    monkeypatch.setattr("viz.pages.work_precision_page.to_adaptive_svg", lambda _: "<svg/>")


def test_a_report_without_results_is_still_a_page(undrawn: None) -> None:
    curves = [curve("euler", "equal steps", [point(64.0, 1e-3, 1e6)])]
    empty = content(curves=curves, targets=[], absent={}, conservative=True)
    page = shown(to_html(work_precision(empty)))
    assert "No method came near the exact motion." in page
    assert "Every method that was asked has points." in page


def test_missing_numbers_are_dashes(undrawn: None) -> None:
    lost = point(64.0, 1e-3, 1.0, largest=None, drift=None, step=None, steps=None)
    report = content(curves=[curve("rk4", "equal steps", [lost])])
    rows = next(s for s in work_precision(report).sections if s.anchor == "points").blocks[1]
    assert isinstance(rows, Table)
    assert rows.rows == [["64", "-", "-", "40", "1 ms", "1.5 ms", "1.0e0", "-", "-"]]


MEASURED = ["report", "spring_mass", "--quick", "--methods", "rk4,dop853"]


def test_the_command_writes_whole_files(tmp_path: Path, capsys: pytest.CaptureFixture[str], undrawn: None) -> None:
    assert cli.main([*MEASURED, "--t-end", "2", "--start", "1,0.5", "--out", str(tmp_path / "r")]) == 0
    assert "spring_mass.html: 2 integrators" in capsys.readouterr().out
    names = {path.name for path in (tmp_path / "r").iterdir()}
    pictures = {f"spring_mass-{name}.svg" for name in ("time", "orders", "energy")}
    assert names == {*pictures, "exact", *(f"spring_mass.{kind}" for kind in ("html", "md", "csv", "json"))}
    data = json.loads((tmp_path / "r" / "spring_mass.json").read_text())
    assert (data["t_end"], data["states"]) == (2.0, 2)
    assert {each["name"] for each in data["curves"]} == {"rk4", "dop853"}


def test_an_interrupted_report_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("dynamics.experiments.work_precision.work_precision.time_in_turns", interrupt)
    assert cli.main([*MEASURED, "--out", str(tmp_path / "r")]) == 130
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert left == []
