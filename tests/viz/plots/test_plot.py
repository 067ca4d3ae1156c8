"""Plots as SVG: the ink of a picture follows the page."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

pytest.importorskip("matplotlib")

from viz import theme
from viz.plots.direct_labels import bars
from viz.plots.plot import to_adaptive_svg


def test_the_ink_of_a_picture_follows_the_page() -> None:
    svg = to_adaptive_svg(bars(["a", "b"], [0.1, 20.0], "time [s]"))
    root = ElementTree.fromstring(svg)
    (style,) = [each for each in root.iter("{http://www.w3.org/2000/svg}style") if "prefers" in (each.text or "")]
    assert theme.DARK_TEXT in str(style.text)
    assert "fill: currentColor" in str(style.text)  # of letters, which have no color of their own
    drawn = svg.replace(str(style.text), "")
    for ink in (theme.TEXT, theme.LINE, "#000000", "#FFFFFF"):
        assert ink.lower() not in drawn.lower()
