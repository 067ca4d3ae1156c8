"""Panels of an animation: moving sticks, and curves over time, side by side, as artists of matplotlib."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array

from .. import theme
from ..plots.plot import empty_figure, style, to_gif
from .surfaces import grid, surfaces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

RATE = 25  # frames a second: a GIF counts in hundredths, and browsers slow down what is faster than 50
PANEL, TITLE, CLOCK = 3.68, 0.3, 0.26  # inches: of a panel, the words above it, the time below
SIZE, SMALL = 10, 8.5  # of letters
FOLLOW = 5.0  # how much larger than the mechanism its way is where the frame goes with it
FRAME_ROWS = 4  # instants a frame, of the ways and curves that are drawn
TRACE = RATE * FRAME_ROWS  # instants that the tip's way is shown for
NAMED = 7  # curves at most
SMALLEST = 1e-300  # what float64 has room for, with a product to spare
CURVE_ROUNDING = 1e-12  # of the largest value of a curve: a change that is none
BREAK = np.full((1, 2), np.nan)  # between lines that are one artist


@dataclass(frozen=True)
class Colors:
    """page, text, and faint: what stands still or was wanted; wrong: the one color of what is wrong; series."""

    page: str
    text: str
    faint: str
    wrong: str
    links: tuple[str, ...]
    series: tuple[str, ...]


_SERIES = tuple([each for each in theme.SERIES if each not in (theme.YELLOW, theme.SPURIOUS)])
LIGHT = Colors(theme.WHITE, theme.TEXT, theme.tint(theme.GRAY, 0.55), theme.SPURIOUS, theme.LINKS, _SERIES)
DARK = Colors(
    theme.DARK_PAGE,
    theme.DARK_TEXT,
    "#5C6066",
    "#FF8A4D",
    tuple([theme.tint(each, 0.7) for each in theme.LINKS]),
    tuple([theme.WHITE if each == theme.BLACK else theme.tint(each, 0.8) for each in _SERIES]),
)


@dataclass(frozen=True)
class Motion:
    """Content of a panel.  values: (T, k, 2) points [m] or (T, m) curves, `FRAME_ROWS` a frame.  wrong: painted so."""

    title: str
    values: Array
    wrong: bool = False


class FilmPanel(ABC):
    """One kind of panel; all of a film share its scale.  wanted: as the motions' values, drawn faint, or None."""

    margins = (0.0, 0.0, 0.0, 0.0)  # inches: left, below, right and above the axes

    def __init__(self, motions: Sequence[Motion], wanted: Array | None) -> None:
        self.motions, self.wanted = motions, wanted
        self.all = np.concatenate([motion.values for motion in motions] + ([] if wanted is None else [wanted]))

    @abstractmethod
    def draw(self, axis: Axes, motion: Motion, colors: Colors) -> Callable[[int], None]:
        """Add the artists of a motion; the function moves them to a row."""


class Sticks(FilmPanel):
    """Points that move, as sticks from their parents, (k,), -1 for what hangs in the world.

    Behind the k points come those of spheres of these radii [m] and of planes, see `surfaces`.
    """

    def __init__(
        self, motions: Sequence[Motion], wanted: Array | None, parents: Sequence[int], radii: Sequence[float] = ()
    ) -> None:
        super().__init__(motions, wanted)
        self.parents, self.radii = np.asarray(parents), radii
        joints, touching = np.split(self.all, [len(parents)], axis=1)
        self.grounded = touching.shape[1] > 2 * len(radii)
        size, centers = np.asarray(radii)[:, np.newaxis], touching[:, : 2 * len(radii) : 2]
        seen = np.concatenate([joints, centers - size, centers + size], axis=1)
        low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
        low, high = np.minimum(low, 0.0), np.maximum(high, 0.0)
        middles = (joints.min(axis=1) + joints.max(axis=1)) / 2.0
        reach, way = float(np.abs(seen - middles[:, np.newaxis]).max()), float((high - low).max())
        self.follows = way > FOLLOW * 2.0 * reach > 0.0
        self.half = 1.5 * reach if self.follows else 0.54 * (way or 1.0)
        self.center = (low + high) / 2.0

    def draw(self, axis: Axes, motion: Motion, colors: Colors) -> Callable[[int], None]:
        """A ghost of what was wanted, the way of the tip, and the sticks."""
        count, parents = len(self.parents), self.parents
        paint = [colors.wrong] if motion.wrong else list(colors.links)
        width = 3.6 if count < 12 else 2.2
        shade = np.maximum(parents, 0) % len(paint)
        held = parents >= 0
        axis.set(xticks=[], yticks=[], aspect="equal")
        axis.spines[:].set_visible(False)
        grids, ghost, edges, tip, balls = (
            _line(axis, color=color, linewidth=wide)
            for color, wide in (
                (colors.faint, 0.4),
                (colors.faint, width),
                (colors.text, 1.1),
                (paint[shade[-1]], 0.9),
                (colors.text, 1.1),
            )
        )
        if not (self.follows or self.grounded):
            axis.plot([-0.07 * self.half, 0.07 * self.half], [0.0, 0.0], color=colors.text, linewidth=1.5)
        sticks = [_line(axis, color=color, linewidth=width) for color in paint]
        joints = [
            _line(axis, color=color, linestyle="", marker="o", markersize=1.4 * width, markerfacecolor=colors.page)
            for color in paint
        ]
        step = _nice(0.6 * self.half)

        def move(k: int) -> None:
            points, touching = np.split(motion.values[k], [count])
            center = (points.min(axis=0) + points.max(axis=0)) / 2.0 if self.follows else self.center
            axis.set_xlim(center[0] - self.half, center[0] + self.half)
            axis.set_ylim(center[1] - self.half, center[1] + self.half)
            seen = surfaces(touching, self.radii, center, self.half, step)
            still = grid(np.zeros(2), np.eye(2), center, self.half, step)  # in the world, while the frame goes along
            _put(grids, still if self.follows and not seen.grids else seen.grids)
            _put(edges, seen.edges)
            _put(balls, [line for sphere in seen.spheres for line in sphere])
            _put(tip, [motion.values[max(0, k - TRACE) : k + 1, count - 1]])
            if self.wanted is not None:
                _put(ghost, [self.wanted[k, [parents[i], i]] for i in np.flatnonzero(held)])
            for c in range(len(paint)):
                _put(sticks[c], [points[[parents[i], i]] for i in np.flatnonzero(held & (shade == c))])
                _put(joints[c], [points[shade == c]])

        return move


class Curves(FilmPanel):
    """Coordinates over time: what has been, and where each is now.  names: of the curves, (m,).  t: (T,) [s]."""

    margins = (0.6, 0.25, 0.7, 0.1)

    def __init__(self, motions: Sequence[Motion], wanted: Array | None, names: Sequence[str], t: Array) -> None:
        super().__init__(motions, wanted)
        self.names, self.t = names[:NAMED], t
        shown = self.all[:, :NAMED]
        self.low, self.high = float(shown.min()), float(shown.max())
        largest = max(abs(self.low), abs(self.high))
        if largest > 1.0 / SMALLEST:
            raise ValueError(f"coordinates up to {largest:.3g} are too large to be drawn")
        if self.high - self.low <= max(CURVE_ROUNDING * largest, SMALLEST):  # nothing moves
            pad = 0.5 * (largest if largest > SMALLEST else 1.0)
            self.low, self.high = self.low - pad, self.high + pad

    def draw(self, axis: Axes, motion: Motion, colors: Colors) -> Callable[[int], None]:
        """Axes with their numbers, and the curves up to a row."""
        axis.set(xlim=(self.t[0], self.t[-1]), ylim=(self.low, self.high))
        axis.locator_params(nbins=4)
        axis.xaxis.set_major_formatter("{x:g} s")
        axis.tick_params(colors=colors.text, labelsize=SMALL, length=0.0)
        axis.grid(axis="y", color=colors.faint, linewidth=0.4)
        axis.spines[:].set_visible(False)
        curves, dots = [], []
        for i, name in enumerate(self.names):
            color = colors.wrong if motion.wrong else colors.series[i % len(colors.series)]
            if self.wanted is not None:
                axis.plot(self.t, self.wanted[:, i], color=colors.faint, linewidth=1.8)
            curves.append(_line(axis, color=color, linewidth=1.5, label=name, clip_on=False))
            dots.append(_line(axis, color=color, marker="o", markersize=5.0, clip_on=False))
        axis.legend(
            loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=SMALL, labelcolor="linecolor",
            handlelength=0.8,
        )  # fmt: skip

        def move(k: int) -> None:
            for i, (curve, dot) in enumerate(zip(curves, dots, strict=True)):
                curve.set_data(self.t[: k + 1], motion.values[: k + 1, i])
                dot.set_data(self.t[k : k + 1], motion.values[k : k + 1, i])

        return move


def film(panel: FilmPanel, t: Array, dark: bool = False, title: str = "") -> bytes:
    """A GIF: the panels of the motions side by side, the time below.

    title: above all, empty for none.  t: (T,) [s], of which every `FRAME_ROWS`th is a frame.
    """
    colors = DARK if dark else LIGHT
    head = 0.3 if title else 0.0
    width, height = PANEL * len(panel.motions), PANEL + TITLE + CLOCK + head
    left, below, right, above = panel.margins
    with style():
        figure = empty_figure(width, height)
        figure.set(layout_engine="none", facecolor=colors.page)
        figure.text(0.5, 1.0 - 0.6 * head / height, title, color=colors.text, size=SIZE + 1, ha="center", va="center")
        clock = figure.text(0.5, 0.5 * CLOCK / height, "", color=colors.text, size=SMALL, ha="center", va="center")
        moves = []
        for i, motion in enumerate(panel.motions):
            size = ((PANEL - left - right) / width, (PANEL - below - above) / height)
            axis = figure.add_axes(((PANEL * i + left) / width, (CLOCK + below) / height, *size), facecolor="none")
            axis.set_title(motion.title, color=colors.wrong if motion.wrong else colors.text, fontsize=SIZE)
            moves.append(panel.draw(axis, motion, colors))

        def frame(k: int) -> None:
            for move in moves:
                move(FRAME_ROWS * k)
            clock.set_text(f"t = {t[FRAME_ROWS * k]:.2f} s")

        return to_gif(figure, frame, (len(t) - 1) // FRAME_ROWS + 1, RATE)


def _line(axis: Axes, **looks: Any) -> Line2D:
    """An empty line."""
    line: Line2D = axis.plot([], [], solid_capstyle="round", **looks)[0]
    return line


def _put(artist: Line2D, lines: Sequence[Array]) -> None:
    """Let one artist be several lines, (k, 2) each."""
    artist.set_data(*np.concatenate([BREAK, *[part for line in lines for part in (line, BREAK)]]).T)


def _nice(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten up to a length."""
    power = float(10.0 ** np.floor(np.log10(length)))
    return max(each * power for each in (1.0, 2.0, 5.0) if each * power <= length * (1.0 + 1e-12))
