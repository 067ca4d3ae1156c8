"""The page of a model in one line of Python."""

import re

import pytest

import cgraph as cg
import dynamics as dyn
import viz
from tests.each_row import each_row
from tests.viz.page_elements import data_of
from viz.pages.html import Page


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
    assert re.fullmatch(r"<Page '.*A <b>pendulum</b>.*' of \d+ characters>", repr(page))


def test_the_page_of_momenta_has_both_forms_their_rows_and_a_machine_of_momenta():
    page = viz.inspect(dyn.planar_arm([1.0, 0.8], [1.0, 0.7]), momentum=True, t_end=0.1)
    data, live = data_of(page), data_of(page, "live-data")
    versions = [version for version in data["versions"] if version["group"] == "momentum"]
    assert [version["name"] for version in versions] == ["Hamilton's equations", "state equation"]
    assert data["view"] == "Hamilton's equations"
    for version in versions:
        assert version["stages"] == ["of positions", "bias", "eliminated", "back out", "rates"]
        assert {stage for _, _, stage in version["labels"]} <= {*version["stages"]}
    assert [name for name, *_ in data["derived"]["outputs"]][-2:] == ["p0", "p1"]
    assert [row["name"] for row in live["inputs"][:4]] == ["q0", "q1", "p0", "p1"]
    assert [version["steps"] == [] for version in versions] == [False, True]


@each_row("start", [{"swing": 1.0}, {"qd0": 1.0}, [0.0, 0.0]])
def test_a_start_that_is_chosen_is_kept(start):
    assert NOTICE not in viz.inspect(PENDULUM, start=start, t_end=0.1, forward=True)


@each_row(
    ("arguments", "named", "message"),
    [
        ((PENDULUM, "page.txt"), {}, "must end in .html"),
        ((PENDULUM, "nowhere/page.html"), {}, "does not exist"),
        ((PENDULUM,), {"start": {"knee": 1.0}}, "there is no knee; it has q.swing, qd.swing"),
        ((PENDULUM,), {"t_end": -1.0}, "t_end must be positive"),
        ((PENDULUM,), {"forward": True, "momentum": True}, "forward and momentum exclude one another"),
    ],
)
def test_what_cannot_be_is_told_and_nothing_is_written(arguments, named, message, here):
    with pytest.raises((ValueError, OSError), match=message):
        viz.inspect(*arguments, **named)
    assert not [*here.iterdir()]
