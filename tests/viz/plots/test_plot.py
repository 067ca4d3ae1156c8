"""Plots as SVG: the ink of a picture follows the page."""

from xml.etree import ElementTree

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from viz import theme
from viz.plots import plot
from viz.plots.plot import snapshots, to_adaptive_svg


def test_the_ink_of_a_picture_follows_the_page() -> None:
    svg = to_adaptive_svg(plot.bars({"ours": {"a": (2.0, 1.0, 5.0)}}, {"a": "red"}, "time [s]"))
    root = ElementTree.fromstring(svg)
    (style,) = [each for each in root.iter("{http://www.w3.org/2000/svg}style") if "prefers" in (each.text or "")]
    assert theme.DARK_TEXT in str(style.text)
    assert "fill: currentColor" in str(style.text)  # of letters, which have no color of their own
    drawn = svg.replace(str(style.text), "")
    for ink in (theme.TEXT, theme.LINE, "#000000", "#FFFFFF"):
        assert ink.lower() not in drawn.lower()


def test_a_bar_has_its_range() -> None:
    groups = {"ours": {"a": (2.0, 1.0, 5.0), "b": (3.0, 2.5, 3.5)}, "others'": {"a": (20.0, 20.0, 20.0)}}
    axis, other = plot.bars(groups, {"a": "red", "b": "blue"}, "ratio").axes
    assert axis.get_ylim() == other.get_ylim() == (0.0, 1.12 * 20.0)  # one scale, so that heights can be compared
    assert [bar.get_height() for bar in axis.patches] == [2.0, 3.0]
    (ranges,) = [container for container in axis.containers if hasattr(container, "has_yerr")]
    assert [segment[:, 1].tolist() for segment in ranges[2][0].get_segments()] == [[1.0, 5.0], [2.5, 3.5]]


def test_dots_lie_on_the_axes_of_the_lines() -> None:
    """Another's positions are drawn where ours are, at the same scale, joint by joint."""
    times = np.linspace(0.0, 1.0, 61)
    positions = np.stack([np.zeros((61, 2)), np.column_stack([np.cos(times), np.sin(times)])], axis=1)
    alone, over = (snapshots(times, positions, [0.0, 0.5, 1.0], dots=dots) for dots in (None, positions + 1e-3))
    for one, other in zip(alone.axes, over.axes, strict=True):
        assert (one.get_xlim(), one.get_ylim()) == (other.get_xlim(), other.get_ylim())
    last = over.axes[2].lines
    dotted = [line.get_xydata() for line in last if line.get_marker() == "." and line.get_markersize() == 5]
    assert np.array_equal(dotted[0], positions[-1] + 1e-3)
