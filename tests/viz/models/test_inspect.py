"""The page of a model in one line of Python."""

from __future__ import annotations

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from viz.inspector import Page


def lagrangian(q, qd, t):
    return 0.5 * qd[0] ** 2 + 9.81 * cg.cos(q[0])


PENDULUM = dyn.System(lagrangian, ["swing"])
NOTICE = "At rest nothing moves, so it starts at q.swing=0.5."


def test_a_model_has_its_page_from_a_start_that_shows_something(tmp_path):
    path = tmp_path / "page.html"
    page = viz.inspect(PENDULUM, path, t_end=0.1, title="A <b>pendulum</b>")
    assert isinstance(page, Page)
    assert path.read_text(encoding="utf-8") == page
    assert NOTICE in page
    assert "<title>A &lt;b&gt;pendulum&lt;/b&gt;</title>" in page


@pytest.mark.parametrize("start", [{"swing": 1.0}, {"qd0": 1.0}, [0.0, 0.0]])
def test_a_start_that_is_chosen_is_kept(start):
    assert NOTICE not in viz.inspect(PENDULUM, start=start, t_end=0.1, forward=True)


@pytest.mark.parametrize(
    ("arguments", "named", "message"),
    [
        ((PENDULUM, "page.txt"), {}, "must end in .html"),
        ((PENDULUM, "nowhere/page.html"), {}, "does not exist"),
        ((PENDULUM,), {"start": {"knee": 1.0}}, "there is no knee; it has q.swing, qd.swing"),
        ((PENDULUM,), {"t_end": -1.0}, "t_end must be positive"),
    ],
)
def test_what_cannot_be_is_told_and_nothing_is_written(arguments, named, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, OSError), match=message):
        viz.inspect(*arguments, **named)
    assert not [*tmp_path.iterdir()]
