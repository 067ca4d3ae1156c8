"""Log-log plots whose curves carry their names at their ends: no legend, and colors that need not tell them apart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cgraph._shared import Array as Points

from .. import theme
from .plot import GRID, empty_figure, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = (theme.BLUE, theme.ORANGE, theme.GREEN, theme.PURPLE, theme.SKY_BLUE)  # seen on white and on black
LABEL = 8.0  # points
APART = 1.1  # of a label's height, from one to the next
LABEL_GAP = 6.0  # points between the end of a curve and its label
LETTER_WIDTH = 0.58  # of a label's size, the width of a letter
REACH = 26  # half heights that a label may be moved up or down
ROOM = 0.2  # of the axis, for the names


@dataclass(frozen=True)
class Line:
    """A curve.  color: a color, or a number, the same for what belongs together; None: a thin guide in ink."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    color: int | str | None = 0
    dashed: bool = False


@dataclass(frozen=True)
class PlotPanel:
    """Curves under a title.  x, y: the axes' names."""

    title: str
    x: str
    y: str
    lines: list[Line]


def labeled(
    panels: Sequence[PlotPanel], *, columns: int = 2, shared: bool = True, rising: bool = False, room: float = ROOM
) -> Figure:
    """Panels with logarithmic axes, x from large on the left to small on the right; `rising`, the other way.

    Curves go from the left to the right.  shared: all panels have the same scales.  room: for names, beside the curves,
    in their width.
    """
    with style():
        rows = -(-len(panels) // columns)
        figure = empty_figure(10.0, 4.4 * rows)
        axes = figure.subplots(rows, columns, sharex=shared, sharey=shared, squeeze=False)
        for axis in axes.flat[len(panels) :]:
            axis.set_axis_off()
        for axis, panel in zip(axes.flat, panels, strict=False):
            axis.set(xscale="log", yscale="log", xlabel=panel.x, ylabel=panel.y)
            for line in panel.lines:
                _draw(axis, line)
            axis.set_title(panel.title, fontsize=10, loc="left")
            axis.tick_params(labelbottom=True, labelleft=True)
            axis.grid(**GRID)
        for axis in axes.flat[:1] if shared else axes.flat[: len(panels)]:
            low, high = axis.get_xlim()
            if len(_decades(low, high)) < 2:
                low, high = 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high))
            left, right = (low, high) if rising else (high, low)
            axis.set_xlim(left, right * (right / left) ** room)
            axis.set_xticks(_decades(low, high))
            axis.xaxis.minorticks_off()
        layout = figure.get_layout_engine()
        assert layout is not None
        layout.execute(figure)
        figure.set_layout_engine(None)  # the names are placed for axes where they are now
        for axis, panel in zip(axes.flat, panels, strict=False):
            _name(axis, panel.lines)
    return figure


def _decades(low: float, high: float) -> list[float]:
    """Powers of ten between two numbers, seven at most."""
    first, last = math.ceil(math.log10(low)), math.floor(math.log10(high))
    every = max(1, -(-(last - first + 1) // 7))
    return [10.0**k for k in range(last, first - 1, -every)]


def _draw(axis: Axes, line: Line) -> None:
    if line.color is None:
        axis.plot(line.x, line.y, color=theme.LINE, linewidth=0.8, linestyle=(0, (1, 2)))
        return
    number, color = (0, line.color) if isinstance(line.color, str) else (line.color, COLORS[line.color % len(COLORS)])
    axis.plot(
        line.x,
        line.y,
        color=color,
        marker="osD^v"[number // len(COLORS) % 5],
        markersize=3.2,
        linewidth=1.4,
        linestyle="--" if line.dashed else "-",
    )


def _name(axis: Axes, lines: Sequence[Line]) -> None:
    """The names to the right of the ends, moved where they would lie on another name or, if it can be, on a curve."""
    scale = axis.figure.dpi / 72.0
    paths = [axis.transData.transform(np.column_stack([line.x, line.y])) for line in lines if len(line.x)]
    inked = np.vstack([_dense(path) for path in paths]) if paths else np.empty((0, 2))
    frame = axis.get_window_extent()
    height, letter = APART * LABEL * scale, LETTER_WIDTH * LABEL * scale
    placed: list[LabelBox] = []
    named = [line for line in lines if len(line.x)]
    for line, path in sorted(zip(named, paths, strict=True), key=lambda pair: -pair[1][-1, 1]):
        end = path[-1]
        width = letter * len(line.name)
        left = min(end[0] + LABEL_GAP * scale, frame.x1 - width)
        choices = [
            LabelBox(left + dx * letter, left + dx * letter + width, end[1] + dy * 0.5 * height, height)
            for dx in (0, 2, 4, 7, 10)
            for dy in range(-REACH, REACH + 1)
            if left + dx * letter + width <= frame.x1 + 1.0
        ]
        inside = [box for box in choices if frame.y0 < box.middle - height / 2 and box.middle + height / 2 < frame.y1]
        best = min(inside or choices, key=lambda box: box.cost(end, placed, inked, letter))
        placed.append(best)
        moved = abs(best.middle - end[1]) > 0.6 * height or best.left - end[0] > 2.5 * LABEL_GAP * scale
        arrow: dict[str, Any] = {"arrowstyle": "-", "color": theme.LINE, "linewidth": 0.5, "shrinkA": 1, "shrinkB": 2}
        axis.annotate(
            line.name,
            (line.x[-1], line.y[-1]),
            xytext=((best.left - end[0]) / scale, (best.middle - end[1]) / scale),
            textcoords="offset points",
            fontsize=LABEL,
            color=theme.TEXT,
            va="center",
            annotation_clip=False,
            arrowprops=arrow if moved else None,
        )


class LabelBox(NamedTuple):
    """Place where a name could be, in pixels."""

    left: float
    right: float
    middle: float
    height: float

    def cost(self, end: Points, placed: Sequence[LabelBox], inked: Points, letter: float) -> float:
        """Cost of a place: on another name is worst, then on curves, then far from the end."""
        names = sum(
            other.left - 2 * letter < self.right
            and self.left - 2 * letter < other.right
            and abs(other.middle - self.middle) < self.height
            for other in placed
        )
        on = (
            (inked[:, 0] > self.left - 2)
            & (inked[:, 0] < self.right)
            & (abs(inked[:, 1] - self.middle) < self.height / 2)
        )
        away = float(abs(self.middle - end[1]) + 0.5 * (self.left - end[0])) / self.height
        return 1000.0 * names + 0.7 * float(np.count_nonzero(on)) + away


def _dense(path: Points) -> Points:
    """Points along a curve, a few pixels apart."""
    parts = [path[-1:]]
    for a, b in itertools.pairwise(path):
        count = max(1, int(np.hypot(*(b - a)) / 4.0))
        parts.append(a + (b - a) * np.linspace(0.0, 1.0, count, endpoint=False)[:, None])
    return np.vstack(parts)
