"""Plots: arrays to matplotlib figures. Nothing here computes physics."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array, required

from .. import theme

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "font.family": theme.FONT,
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": theme.LINE,
    "axes.labelcolor": theme.TEXT,
    "svg.hashsalt": "cgraph",  # the same ids in every run
}
WAY = 400  # points of a way that is drawn, at most
GRID: dict[str, Any] = {"color": "#808080", "alpha": 0.25, "linewidth": 0.6}  # on white and on black


def empty_figure(width: float, height: float) -> Figure:
    """An empty figure, size in inches, drawn without a display. Raises ImportError naming the extra."""
    matplotlib = required("matplotlib.figure", "plots need matplotlib", "viz")
    figure: Figure = matplotlib.Figure(figsize=(width, height), layout="constrained")
    return figure


def check_can_plot() -> None:
    """Raise what a plot would without matplotlib: before the work, and at no cost."""
    empty_figure(1.0, 1.0)


def style() -> AbstractContextManager[None]:
    """A context in which matplotlib draws as all pictures look."""
    from matplotlib import rc_context

    return rc_context(STYLE)


def to_adaptive_svg(figure: Figure, *, background: bool = False) -> str:
    """The figure as SVG text with ink for light and dark pages, as the reader's system asks, and no background.

    background: with one that adapts too, for pages that may have made another choice than the system.
    """
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    svg = buffer.getvalue().decode()
    for ink in (theme.TEXT, theme.LINE, theme.BLACK):
        svg = svg.replace(ink.lower(), "currentColor")
    head, rest = svg.split("<defs>", 1)
    light, night = (f" background: {color};" if background else "" for color in (theme.WHITE, theme.DARK_PAGE))
    dark = f"@media (prefers-color-scheme: dark) {{ svg {{ color: {theme.DARK_TEXT};{night} }} }}"
    return f"{head}<style>svg {{ color: {theme.TEXT}; fill: currentColor;{light} }} {dark}</style>\n <defs>{rest}"


def to_gif(figure: Figure, draw: Callable[[int], None], count: int, rate: int) -> bytes:
    """A film of `count` frames, `rate` a second, that starts again at its end.  draw: makes the figure frame k."""
    from matplotlib.animation import FuncAnimation, PillowWriter

    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.gif"
        FuncAnimation(figure, draw, count, cache_frame_data=False).save(path, PillowWriter(rate), dpi=100)
        return path.read_bytes()


def snapshots(times: Array, positions: Array, instants: Sequence[float], dots: Array | None = None) -> Figure:
    """Poses of an arm at `instants`, a panel each, with the way each joint has come.

    times: (T,) [s].  positions: (T, n + 1, 2) [m], base, joints and tip.  dots: another's positions at the same times,
    drawn as dots on the joints and, a tenth of the time between instants apart, on their ways.
    """
    with style():
        reach = 1.08 * np.abs(positions[..., 0]).max()
        low, high = positions[..., 1].min() - 0.15 * reach, positions[..., 1].max() + 0.15 * reach
        columns = -(-len(instants) // 2)
        stride = max(1, len(times) // WAY)
        panel = 9.0 / columns  # inches; equal scales fix the height
        figure = empty_figure(9.0, 2 * (0.86 * panel * (high - low) / (2 * reach) + 0.42) + 0.3)
        axes = figure.subplots(2, columns, sharex=True, sharey=True)
        for letter, (axis, instant) in zip("abcdefghijkl", zip(axes.flat, instants, strict=False), strict=False):
            row = int(np.abs(times - instant).argmin())
            for joint in range(1, positions.shape[1]):
                color = theme.LINKS[(joint - 1) % len(theme.LINKS)]
                axis.plot(*positions[: row + 1, joint][::-stride].T, color=color, linewidth=1.1, alpha=0.75)
                axis.plot(*positions[row, joint - 1 : joint + 1].T, color=color, linewidth=5, solid_capstyle="round")
            axis.plot(*positions[row, :-1].T, "o", color="white", markeredgecolor=theme.LINE, markersize=5.5)
            if dots is not None:
                every = max(1, len(times) // (10 * len(instants)))
                passed = dots[: row + 1][::-every, 1:].reshape(-1, 2)
                axis.plot(*passed.T, ".", color=theme.TEXT, markersize=2.5)
                axis.plot(*dots[row].T, ".", color=theme.TEXT, markersize=5)
            axis.set_title(f"({letter})  t = {times[row]:.1f} s", fontsize=10, loc="left")
            axis.set(aspect="equal", xlim=(-reach, reach), ylim=(low, high))
            axis.grid(**GRID)
        for axis in axes[-1]:
            axis.set_xlabel("x [m]")
        for axis in axes[:, 0]:
            axis.set_ylabel("y [m]")
    return figure


def over_time(times: Array, values: Array, y: str, colors: Sequence[str]) -> Figure:
    """Curves over time on a logarithmic scale, named "joint 1" and on; what is NaN is left out.

    times: (T,) [s].  values: (T, n), positive.  y: the axis's name.
    """
    with style():
        figure = empty_figure(9.0, 2.8)
        axis = figure.subplots()
        for joint, (column, color) in enumerate(zip(values.T, colors, strict=False), start=1):
            axis.plot(times, column, ".", color=color, markersize=2.0, label=f"joint {joint}")
        axis.set(yscale="log", xlabel="t [s]", ylabel=y)
        axis.grid(**GRID)
        axis.legend(frameon=False, markerscale=5.0, loc="lower right", ncols=values.shape[1])
    return figure


def bars(groups: Mapping[str, Mapping[str, tuple[float, float, float]]], colors: Mapping[str, str], y: str) -> Figure:
    """Bars with a range, {panel: {bar: (height, low, high)}}, a panel for each group, all on one scale.

    colors: {bar: color}.  y: the scale's name.
    """
    with style():
        figure = empty_figure(9.0, 3.6)
        axes = np.atleast_1d(figure.subplots(1, len(groups), sharey=True))
        axes[0].set_ylabel(y)
        for axis, (title, values) in zip(axes, groups.items(), strict=True):
            heights, low, high = (np.array(each) for each in zip(*values.values(), strict=True))
            places = np.arange(len(values))
            axis.bar(places, heights, color=[colors[name] for name in values], width=0.62)
            axis.errorbar(places, heights, [heights - low, high - heights], fmt="none", ecolor=theme.TEXT, capsize=3)
            for place, height, top in zip(places, heights, high, strict=True):
                axis.annotate(
                    f"{height:.3g}", (place, top), xytext=(0, 4), textcoords="offset points", ha="center", fontsize=9
                )
            axis.set_xticks(places, [name.replace(" ", "\n", 1) for name in values])
            axis.set_title(title, fontsize=10, loc="left")
        axes[0].set_ylim(0.0, 1.12 * max([high for group in groups.values() for _, _, high in group.values()]))
    return figure
