"""Panels of an animation: moving sticks, and curves over time, side by side."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cgraph._shared import Array

from .canvas import DARK, LIGHT, RATE, Canvas, Colors, Point
from .surfaces import surfaces

SIDE, TITLE, CLOCK, MARGIN = 340, 30, 26, 14  # pixels: of a panel, its title, the time below, and around
SIZE, SMALL = 14, 12  # of letters
FOLLOW = 5.0  # how much larger than the mechanism its way is where the frame goes with it
FRAME_ROWS = 4  # instants a frame, of the ways and curves that are drawn
TRACE = RATE * FRAME_ROWS  # instants that the tip's way is shown for
NAMED = 7  # curves at most
SMALLEST = 1e-300  # what float64 has room for, with a product to spare
CURVE_ROUNDING = 1e-12  # of the largest value of a curve: a change that is none


@dataclass(frozen=True)
class Motion:
    """Content of a panel.  values: (T, k, 2) points [m] or (T, m) curves, `FRAME_ROWS` a frame.  wrong: painted so."""

    title: str
    values: Array
    wrong: bool = False


class FilmPanel(ABC):
    """One kind of panel; all of a film share its scale.  wanted: as the motions' values, drawn faint, or None."""

    def __init__(self, motions: Sequence[Motion], wanted: Array | None) -> None:
        self.motions, self.wanted = motions, wanted
        self.all = np.concatenate([motion.values for motion in motions] + ([] if wanted is None else [wanted]))

    @abstractmethod
    def draw(self, canvas: Canvas, motion: Motion, k: int, colors: Colors) -> None:
        """Row k of a motion, in the square of `SIDE` below its title, whose left side is at 0."""


class Sticks(FilmPanel):
    """Points that move, as sticks from their parents, (k,), -1 for what hangs in the world.

    Behind the k points come those of spheres of these radii [m] and of planes, see `surfaces`.
    """

    def __init__(
        self, motions: Sequence[Motion], wanted: Array | None, parents: Sequence[int], radii: Sequence[float] = ()
    ) -> None:
        super().__init__(motions, wanted)
        self.parents, self.radii = parents, radii
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

    def draw(self, canvas: Canvas, motion: Motion, k: int, colors: Colors) -> None:
        """A ghost of what was wanted, the way of the tip, and the sticks."""
        points, touching = np.split(motion.values[k], [len(self.parents)])
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0 if self.follows else self.center
        scale = SIDE / (2.0 * self.half)
        step = nice(0.6 * self.half)
        drawn = surfaces(touching, self.radii, center, self.half, step)
        if self.follows and not drawn.grids:
            self._grid(canvas, center, scale, step, colors)

        def at(place: Array) -> Point:
            x, y = (place - center) * (scale, -scale)
            return MARGIN + SIDE / 2.0 + float(x), TITLE + SIDE / 2.0 + float(y)

        for lines, color, width in ((drawn.grids, colors.faint, 0.5), (drawn.edges, colors.text, 1.5)):
            for line in lines:
                canvas.line([at(place) for place in line], color, width)
        if drawn.grids:  # which also lie where the title comes
            canvas.line([(0.0, TITLE / 2.0), (SIDE + 2.0 * MARGIN, TITLE / 2.0)], colors.page, TITLE)
        if self.wanted is not None:
            self._sticks(
                canvas,
                [at(place) for place in self.wanted[k, : len(self.parents)]],
                at(np.zeros(2)),
                [colors.faint],
                None,
            )
        tip = motion.values[max(0, k - TRACE) : k + 1, len(self.parents) - 1]
        paint = [colors.wrong] if motion.wrong else list(colors.links)
        canvas.line([at(place) for place in tip], paint[max(self.parents[-1], 0) % len(paint)], 1.2)
        if not (self.follows or self.grounded):
            x, y = at(np.zeros(2))
            canvas.line([(x - 12.0, y), (x + 12.0, y)], colors.text, 2.0)
        for ring, mark in drawn.spheres:
            for line in (ring, mark):
                canvas.line([at(place) for place in line], colors.text, 1.5)
        self._sticks(canvas, [at(place) for place in points], at(np.zeros(2)), paint, colors.page)

    def _sticks(
        self, canvas: Canvas, points: Sequence[Point], world: Point, paint: Sequence[str], page: str | None
    ) -> None:
        """page: the color inside a joint; None for a ghost without joints."""
        width = 5.0 if len(points) < 12 else 3.0
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                color = paint[parent % len(paint)]
                canvas.line([points[parent], points[i]], color, width)
                if page is None:
                    for end in (points[parent], points[i]):
                        canvas.circle(end, width / 2.0, color)
        if page is not None:
            for i, point in enumerate(points):
                canvas.circle(point, 0.9 * width, page, paint[max(self.parents[i], 0) % len(paint)], 2.0)

    def _grid(self, canvas: Canvas, center: Array, scale: float, step: float, colors: Colors) -> None:
        """Lines that stand still in the world, for a frame that goes with the mechanism."""
        for axis in (0, 1):
            first = math.ceil((center[axis] - self.half) / step)
            for i in range(first, math.floor((center[axis] + self.half) / step) + 1):
                shift = (i * step - center[axis]) * scale
                if axis == 0:
                    x = MARGIN + SIDE / 2.0 + shift
                    canvas.line([(x, TITLE), (x, TITLE + SIDE)], colors.faint, 0.5)
                else:
                    y = TITLE + SIDE / 2.0 - shift
                    canvas.line([(MARGIN, y), (MARGIN + SIDE, y)], colors.faint, 0.5)


class Curves(FilmPanel):
    """Coordinates over time: what has been, and where each is now.  names: of the curves, (m,).  t: (T,) [s]."""

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

    def draw(self, canvas: Canvas, motion: Motion, k: int, colors: Colors) -> None:
        """Axes with their numbers, and the curves up to row k."""
        step = nice((self.high - self.low) / 3.0)
        ticks = [i * step for i in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]
        left = MARGIN + 8.0 + max([canvas.width_of(_number(tick), SMALL) for tick in ticks], default=0.0)
        right = MARGIN + SIDE - max(canvas.width_of(name, SMALL) for name in self.names) - 12.0
        top, bottom = TITLE + 8.0, TITLE + SIDE - 22.0
        span = (self.t[-1] - self.t[0]) or 1.0
        columns = left + (right - left) * (self.t - self.t[0]) / span

        def height(values: Array) -> Array:
            found: Array = bottom - (bottom - top) * (values - self.low) / (self.high - self.low)
            return found

        for tick in ticks:
            y = float(height(np.array(tick)))
            canvas.line([(left, y), (right, y)], colors.faint, 0.5)
            canvas.text((left - 5.0, y), _number(tick), colors.text, SMALL, "rm")
        for end, anchor in ((0, "la"), (-1, "ra")):
            canvas.text((float(columns[end]), bottom + 6.0), f"{self.t[end]:g} s", colors.text, SMALL, anchor)
        labels = []
        for i, name in enumerate(self.names):
            color = colors.wrong if motion.wrong else colors.series[i % len(colors.series)]
            if self.wanted is not None:
                canvas.line([*zip(columns, height(self.wanted[:, i]), strict=True)], colors.faint, 2.5)
            rows = height(motion.values[: k + 1, i])
            canvas.line([*zip(columns[: k + 1], rows, strict=True)], color, 2.0)
            canvas.circle((float(columns[k]), float(rows[-1])), 4.0, color)
            labels.append((float(rows[-1]), name, color))
        for y, name, color in _apart(labels, top, bottom):
            canvas.text((float(columns[k]) + 8.0, y), name, color, SMALL)


def film(panel: FilmPanel, t: Array, dark: bool = False, title: str = "") -> Callable[[int], Canvas]:
    """Function that draws a frame: the panels of the motions side by side, the time below.

    title: above all, empty for none.  t: (T,) [s], of which every `FRAME_ROWS`th is a frame.
    """
    colors = DARK if dark else LIGHT
    wide = SIDE + 2 * MARGIN
    head = 28 if title else 0
    width, height = wide * len(panel.motions), head + TITLE + SIDE + CLOCK
    blank = Canvas(width, height, colors.page)
    if title:
        blank.text((width / 2.0, 18.0), title, colors.text, SIZE + 1, "mm")

    def frame(k: int) -> Canvas:
        canvas = blank.copy()
        for i, motion in enumerate(panel.motions):
            part = Canvas(wide, TITLE + SIDE, colors.page)
            panel.draw(part, motion, FRAME_ROWS * k, colors)
            part.text(
                (wide / 2.0, TITLE / 2.0), motion.title, colors.wrong if motion.wrong else colors.text, SIZE, "mm"
            )
            canvas.put(part, i * wide, head)
        canvas.text((width / 2.0, height - CLOCK / 2.0), f"t = {t[FRAME_ROWS * k]:.2f} s", colors.text, SMALL, "mm")
        return canvas

    return frame


def nice(length: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten up to a length."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(each * power for each in (1.0, 2.0, 5.0) if each * power <= length * (1.0 + 1e-12))


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")


def _apart(labels: Sequence[tuple[float, str, str]], top: float, bottom: float) -> list[tuple[float, str, str]]:
    """Labels moved so that none covers another, in their order from above."""
    line = SMALL + 3.0
    placed: list[tuple[float, str, str]] = []
    for y, name, color in sorted(labels, key=lambda label: round(label[0])):  # of equal heights in their order
        placed.append((max(y, placed[-1][0] + line if placed else top), name, color))
    low = bottom
    for i in range(len(placed) - 1, -1, -1):
        placed[i] = (min(placed[i][0], low), *placed[i][1:])
        low = placed[i][0] - line
    return placed
