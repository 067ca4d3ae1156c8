"""Panels of an animation: sticks among spheres and planes, and curves over time, as artists of matplotlib."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cgraph._shared import Array

from .. import theme
from ..plots.plot import empty_figure, style, to_gif

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
EDGE_ON = 0.05  # of a plane's square: how little of it is seen where a line stands for the plane
_RING = np.linspace(0.0, 2.0 * np.pi, 49)
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


class FilmPanel(NamedTuple):
    """One kind of panel; all of a film share its scale.

    draw: adds the artists of a motion to axes; the function that it gives moves them to a row.
    margins: left, below, right and above the axes [inches].
    """

    motions: Sequence[Motion]
    draw: Callable[[Axes, Motion, Colors], Callable[[int], None]]
    margins: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


def sticks(
    motions: Sequence[Motion], wanted: Array | None, parents: Sequence[int], radii: Sequence[float] = ()
) -> FilmPanel:
    """Points that move, as sticks from their parents, (k,), -1 for what hangs in the world.

    Behind the k points come those of spheres of these radii [m] and of planes, see `surfaces`.
    wanted: as the motions' values, drawn faint, or None.
    """
    count, hung_on = len(parents), np.asarray(parents)
    joints, touching = np.split(_all(motions, wanted), [count], axis=1)
    grounded = touching.shape[1] > 2 * len(radii)
    size, centers = np.asarray(radii)[:, np.newaxis], touching[:, : 2 * len(radii) : 2]
    seen = np.concatenate([joints, centers - size, centers + size], axis=1)
    low, high = np.minimum(seen.min(axis=(0, 1)), 0.0), np.maximum(seen.max(axis=(0, 1)), 0.0)
    middles = (joints.min(axis=1) + joints.max(axis=1)) / 2.0
    reach, way = float(np.abs(seen - middles[:, np.newaxis]).max()), float((high - low).max())
    follows = way > FOLLOW * 2.0 * reach > 0.0
    half = 1.5 * reach if follows else 0.54 * (way or 1.0)

    def draw(axis: Axes, motion: Motion, colors: Colors) -> Callable[[int], None]:
        """A ghost of what was wanted, the way of the tip, and the sticks."""
        paint = [colors.wrong] if motion.wrong else list(colors.links)
        width = 3.6 if count < 12 else 2.2
        shade = np.maximum(hung_on, 0) % len(paint)
        held = hung_on >= 0
        axis.set(xticks=[], yticks=[], aspect="equal")
        axis.spines[:].set_visible(False)
        grids, ghost = (_line(axis, color=colors.faint, linewidth=wide) for wide in (0.4, width))
        edges = _line(axis, color=colors.text, linewidth=1.1)
        tip = _line(axis, color=paint[shade[-1]], linewidth=0.9)
        balls = _line(axis, color=colors.text, linewidth=1.1)
        if not (follows or grounded):
            axis.plot([-0.07 * half, 0.07 * half], [0.0, 0.0], color=colors.text, linewidth=1.5)
        rods = [_line(axis, color=color, linewidth=width) for color in paint]
        dots = [
            _line(axis, color=color, linestyle="", marker="o", markersize=1.4 * width, markerfacecolor=colors.page)
            for color in paint
        ]
        step = _nice(0.6 * half)

        def move(k: int) -> None:
            points, touching = np.split(motion.values[k], [count])
            center = (points.min(axis=0) + points.max(axis=0)) / 2.0 if follows else (low + high) / 2.0
            axis.set_xlim(center[0] - half, center[0] + half)
            axis.set_ylim(center[1] - half, center[1] + half)
            seen = surfaces(touching, radii, center, half, step)
            still = grid(np.zeros(2), np.eye(2), center, half, step)  # in the world, while the frame goes along
            _put(grids, still if follows and not seen.grids else seen.grids)
            _put(edges, seen.edges)
            _put(balls, [line for sphere in seen.spheres for line in sphere])
            _put(tip, [motion.values[max(0, k - TRACE) : k + 1, count - 1]])
            if wanted is not None:
                _put(ghost, [wanted[k, [hung_on[i], i]] for i in np.flatnonzero(held)])
            for c in range(len(paint)):
                _put(rods[c], [points[[hung_on[i], i]] for i in np.flatnonzero(held & (shade == c))])
                _put(dots[c], [points[shade == c]])

        return move

    return FilmPanel(motions, draw)


def curves(motions: Sequence[Motion], wanted: Array | None, names: Sequence[str], t: Array) -> FilmPanel:
    """Coordinates over time: what has been, and where each is now.  names: of the curves, (m,).  t: (T,) [s]."""
    shown = _all(motions, wanted)[:, :NAMED]
    low, high = float(shown.min()), float(shown.max())
    largest = max(abs(low), abs(high))
    if largest > 1.0 / SMALLEST:
        raise ValueError(f"coordinates up to {largest:.3g} are too large to be drawn")
    if high - low <= max(CURVE_ROUNDING * largest, SMALLEST):  # nothing moves
        pad = 0.5 * (largest if largest > SMALLEST else 1.0)
        low, high = low - pad, high + pad

    def draw(axis: Axes, motion: Motion, colors: Colors) -> Callable[[int], None]:
        """Axes with their numbers, and the curves up to a row."""
        axis.set(xlim=(t[0], t[-1]), ylim=(low, high))
        axis.locator_params(nbins=4)
        axis.xaxis.set_major_formatter("{x:g} s")
        axis.tick_params(colors=colors.text, labelsize=SMALL, length=0.0)
        axis.grid(axis="y", color=colors.faint, linewidth=0.4)
        axis.spines[:].set_visible(False)
        drawn, dots = [], []
        for i, name in enumerate(names[:NAMED]):
            color = colors.wrong if motion.wrong else colors.series[i % len(colors.series)]
            if wanted is not None:
                axis.plot(t, wanted[:, i], color=colors.faint, linewidth=1.8)
            drawn.append(_line(axis, color=color, linewidth=1.5, label=name, clip_on=False))
            dots.append(_line(axis, color=color, marker="o", markersize=5.0, clip_on=False))
        axis.legend(
            loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=SMALL, labelcolor="linecolor",
            handlelength=0.8,
        )  # fmt: skip

        def move(k: int) -> None:
            for i, (curve, dot) in enumerate(zip(drawn, dots, strict=True)):
                curve.set_data(t[: k + 1], motion.values[: k + 1, i])
                dot.set_data(t[k : k + 1], motion.values[k : k + 1, i])

        return move

    return FilmPanel(motions, draw, margins=(0.6, 0.25, 0.7, 0.1))


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


def _all(motions: Sequence[Motion], wanted: Array | None) -> Array:
    return np.concatenate([motion.values for motion in motions] + ([] if wanted is None else [wanted]))


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


class Lines(NamedTuple):
    """Lines through points (k, 2) [m]: rings and marks of spheres, planes seen from the edge, and lines of others."""

    spheres: list[tuple[Array, Array]]
    edges: list[Array]
    grids: list[Array]


def surfaces(points: Array, radii: Sequence[float], center: Array, half: float, step: float) -> Lines:
    """Lines of surfaces in a picture of so much around its center.

    points: (m, 2) [m], the center and mark of each sphere, then of each plane a point and those 1 m along it.
    step: between the lines of a grid [m].
    """
    balls, planes = np.split(points, [2 * len(radii)])
    ring = np.stack([np.cos(_RING), np.sin(_RING)], axis=1)
    lines = Lines([], [], [])
    for radius, place in zip(radii, balls.reshape(-1, 2, 2), strict=True):
        lines.spheres.append((place[0] + (radius or half / 80.0) * ring, place))
    for origin, *ends in planes.reshape(-1, 3, 2):
        ways = np.array(ends) - origin
        if abs(np.linalg.det(ways)) > EDGE_ON:
            lines.grids.extend(grid(origin, ways, center, half, step))
        else:
            way = max(ways, key=np.linalg.norm)
            way = way / (np.linalg.norm(way) or 1.0)
            middle = origin + np.dot(center - origin, way) * way
            lines.edges.append(np.stack([middle - 2.0 * half * way, middle + 2.0 * half * way]))
    return lines


def grid(origin: Array, ways: Array, center: Array, half: float, step: float) -> list[Array]:
    """Lines of a plane, a step of its ways apart, around its place behind the middle of the picture."""
    around = np.round(np.linalg.solve(ways.T, center - origin) / step)
    many = math.ceil(3.0 * half / step)
    shifts, ends = np.arange(-many, many + 1), np.array([-many, many])
    along = [np.stack([ends, np.full(2, shift)], axis=1) for shift in shifts]
    return [origin + step * (around + each) @ ways for each in [*along, *[line[:, ::-1] for line in along]]]
