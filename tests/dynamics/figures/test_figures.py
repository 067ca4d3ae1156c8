"""Figures of pages that no command prints."""

from __future__ import annotations

import shutil

import pytest

import cgraph as cg
import dynamics as dyn
from tests.dynamics.figures import balanced_order, both_forms, parallel_c
from tests.each_row import each_row


@each_row("name", both_forms.FIGURES)
def test_both_forms_and_their_linearizations_are_counted_and_timed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(both_forms, "SECONDS", 1e-4)
    this = both_forms.FIGURES[name]
    first, *others, one_ratio, other_ratio = both_forms.rows(this, "planar 3", 1)
    for row, derive in zip((first, *others), this.forms.values(), strict=True):
        counts = derive(both_forms.MODELS["planar 3"]()).counts()
        assert list(row[1 : 1 + len(this.sizes)]) == [str(getattr(counts, size)) for size in this.sizes]
    for ratios, row in zip((one_ratio, other_ratio), others, strict=True):
        assert float(ratios[1]) == pytest.approx(int(row[1]) / int(first[1]), abs=1e-3)
        assert all(float(each) > 0.0 for each in ratios[1:])
    *_, ratio = both_forms.rows(this._replace(compiled=1), "planar 3", 1)  # too large to be timed
    assert list(ratio[1 + len(this.sizes) :]) == ["-"] * len(this.ways)


def test_a_schedule_is_bounded_by_work_and_by_depth() -> None:
    x = cg.variables([f"x{i}" for i in range(8)])
    total = x[0] + x[1]
    for node in x[2:]:
        total = total * node
    chain = cg.Graph(x, {"y": total})
    assert [balanced_order.schedule(chain, units) for units in (1, 4)] == [7, 7]
    pairs = [x[2 * i] * x[2 * i + 1] for i in range(4)]
    tree = cg.Graph(x, {"y": (pairs[0] + pairs[1]) * (pairs[2] + pairs[3])})
    assert [balanced_order.schedule(tree, units) for units in (1, 2, 4, 8)] == [7, 4, 3, 3]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_lanes_and_threads_give_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel_c, "ROUNDS", 1)
    arm = dyn.planar_arm([0.9] * 3, [0.7] * 3, damping=0.1)
    graph = balanced_order.trigonometry_given(balanced_order.solved(arm, "balanced"))
    found = parallel_c.times(graph, graph.inputs[:3], ["x0"])
    sums = [total for _, total in found.values()]
    x = [0.2 + 0.8 * ((i * 7919) % 1000) / 1000.0 for i in range(len(graph.inputs))]
    exact = sum(graph.evaluate(dict(zip(graph.input_names, x, strict=True))).values())
    assert sums == pytest.approx([exact] * 5, rel=1e-12)
    with pytest.raises(ValueError, match="the graph has sin, where sums, products and quotients were needed"):
        parallel_c.times(cg.Graph(graph.inputs, {"y": cg.sin(graph.inputs[0])}), [], [])
