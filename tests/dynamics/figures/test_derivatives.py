"""Pictures of derivatives: every number has its mark, and the background follows the page."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from tests.dynamics.figures.derivatives import Dots, dots, painted_paths
from viz import theme
from viz.plots.plot import to_adaptive_svg


def test_every_number_of_every_group_has_a_mark() -> None:
    one = Dots("one", ["a", "b", "c"], {"x": [1.0, 2.0, 3.0], "y": [0.1, 0.2, 0.3]}, "size", logarithmic=True)
    other = Dots("other", ["a", "b"], {"y": [-1.0, 1.0], "z": [0.0, 0.0]}, "size")
    axes = dots([one, other]).axes
    drawn = [{str(line.get_label()): np.asarray(line.get_ydata()).tolist() for line in axis.lines} for axis in axes]
    assert drawn == [one.series, other.series]
    colors = [{str(line.get_label()): line.get_color() for line in axis.lines} for axis in axes]
    assert colors[0]["y"] == colors[1]["y"]
    assert len({color for each in colors for color in each.values()}) == 3


def test_a_path_is_painted_by_its_values() -> None:
    t = np.linspace(0.0, 1.0, 11)
    path = np.column_stack([np.cos(t), np.sin(t)])
    values = {"a": 10.0**t, "b": 10.0 ** (1.0 - t)}
    axes = painted_paths(path, t, values, "size").axes
    painted = [axis.collections[0] for axis in axes[:2]]
    for collection, rising in zip(painted, (True, False), strict=True):
        by_time = np.asarray(collection.get_array())
        assert len(by_time) == 10
        assert bool(np.all(np.diff(by_time) > 0.0)) is rising
    assert painted[0].norm.vmax == painted[1].norm.vmax == 10.0


def test_a_background_adapts_with_the_ink() -> None:
    figure = dots([Dots("one", ["a"], {"x": [1.0]}, "size")])
    alone, backed = to_adaptive_svg(figure), to_adaptive_svg(figure, background=True)
    for color in (theme.WHITE, theme.DARK_PAGE):
        assert f"background: {color};" in backed
    assert "background" not in alone
