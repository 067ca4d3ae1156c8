"""Log-log plots: names at the ends of curves lie apart, and axes have their powers of ten."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from matplotlib.text import Text

from viz.plots.direct_labels import Line, PlotPanel, labeled


def test_names_lie_apart_and_inside() -> None:
    """Ten curves that end within a few pixels of each other."""
    x = np.geomspace(1e-1, 1e-9, 9)
    lines = [Line(f"contender {k}", x, 1e-3 * (1 + 0.03 * k) * x**-0.2, k) for k in range(10)]
    figure = labeled([PlotPanel("many", "x", "y", lines)], columns=1)
    figure.draw_without_rendering()
    (axis,) = figure.axes
    boxes = [Text.get_window_extent(text) for text in axis.texts]  # without the lines that lead to them
    assert len(boxes) == 10
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            assert not (a.x0 < b.x1 and b.x0 < a.x1 and a.y0 + 1 < b.y1 and b.y0 + 1 < a.y1)
    frame = axis.get_window_extent()
    assert all(box.x1 <= frame.x1 + 0.1 * frame.width for box in boxes)
    assert all(frame.y0 < box.y0 + 2 and box.y1 - 2 < frame.y1 for box in boxes)


def test_a_narrow_axis_has_two_powers_of_ten() -> None:
    figure = labeled([PlotPanel("narrow", "x", "y", [Line("a", [3e-5, 2e-5], [1.0, 2.0])])], columns=1)
    (axis,) = figure.axes
    assert [tick for tick in axis.get_xticks() if 1e-6 < tick < 1e-3] == pytest.approx([1e-4, 1e-5])


def test_an_axis_may_rise_and_a_curve_have_its_own_color() -> None:
    line = Line("chain rule", [1.0, 10.0, 100.0], [1.0, 2.0, 3.0], "#123456")
    left, right = (labeled([PlotPanel("p", "x", "y", [line])], columns=1, rising=up).axes[0] for up in (False, True))
    assert left.get_xlim()[0] > left.get_xlim()[1]
    assert right.get_xlim()[0] < 1.0 < 100.0 < right.get_xlim()[1]
    assert right.lines[0].get_color() == "#123456"
