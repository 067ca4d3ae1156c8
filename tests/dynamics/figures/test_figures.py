"""Figures of pages that no command prints."""

import pytest

import cgraph as cg
from tests.dynamics.figures import both_forms
from tests.each_row import each_row


@each_row("name", both_forms.FIGURES)
def test_both_forms_and_their_linearizations_are_counted_and_timed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(both_forms, "SECONDS", 1e-4)
    this = both_forms.FIGURES[name]
    rows = both_forms.rows(this, "planar 3", 1)
    first, *others = rows[: len(this.forms)]
    for row, derive in zip((first, *others), this.forms.values(), strict=True):
        counts = derive(both_forms.MODELS["planar 3"]()).counts()
        assert list(row[1 : 1 + len(this.sizes)]) == [str(getattr(counts, size)) for size in this.sizes]
    for ratios, row in zip(rows[len(this.forms) :], others, strict=True):
        assert float(ratios[1]) == pytest.approx(int(row[1]) / int(first[1]), abs=1e-3)
        assert all(float(each) > 0.0 for each in ratios[1:])
    *_, ratio = both_forms.rows(this._replace(compiled=1), "planar 3", 1)  # too large to be timed
    assert list(ratio[1 + len(this.head) :]) == ["-"] * len(this.ways)


def test_a_schedule_is_bounded_by_work_and_by_depth() -> None:
    x = cg.variables([f"x{i}" for i in range(8)])
    total = x[0] + x[1]
    for node in x[2:]:
        total = total * node
    chain = cg.Graph(x, {"y": total})
    assert [both_forms.schedule(chain, units) for units in (1, 4)] == [7, 7]
    pairs = [x[2 * i] * x[2 * i + 1] for i in range(4)]
    tree = cg.Graph(x, {"y": (pairs[0] + pairs[1]) * (pairs[2] + pairs[3])})
    assert [both_forms.schedule(tree, units) for units in (1, 2, 4, 8)] == [7, 4, 3, 3]
