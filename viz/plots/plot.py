"""Plots: arrays to matplotlib figures. Nothing here computes physics."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph.extend import install

from .. import theme

if TYPE_CHECKING:
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

Array = np.ndarray[Any, np.dtype[np.float64]]
STYLE: dict[Any, Any] = {
    "font.family": theme.FONT,
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": theme.LINE,
    "axes.labelcolor": theme.TEXT,
    "svg.hashsalt": "cgraph",  # the same ids in every run
}
GRID: dict[str, Any] = {"color": "#808080", "alpha": 0.25, "linewidth": 0.6}  # on white and on black


def empty_figure(width: float, height: float) -> Figure:
    """An empty figure, size in inches, drawn without a display. Raises ImportError naming the extra."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError(f"plots need matplotlib: {install('viz')}") from error
    return Figure(figsize=(width, height), layout="constrained")


def check_can_plot() -> None:
    """Raise what a plot would without matplotlib: before the work, and at no cost."""
    empty_figure(1.0, 1.0)


def style() -> Any:
    """A context in which matplotlib draws as all pictures look."""
    from matplotlib import rc_context

    return rc_context(STYLE)


def to_svg(figure: Figure) -> str:
    """The figure as SVG text, the same bytes in every run."""
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue().decode()


def to_adaptive_svg(figure: Figure, *, background: bool = False) -> str:
    """As `to_svg`, with ink for light and dark pages, as the reader's system asks, and no background.

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


def painted_line(points: Array, values: Array, limits: tuple[float, float], colors: Sequence[str]) -> LineCollection:
    """A line whose pieces are painted by their values, on a logarithmic scale from the first color to the last.

    points: (T, 2).  values: (T - 1,), positive.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    pieces = np.stack([points[:-1], points[1:]], axis=1)
    ramp = LinearSegmentedColormap.from_list("ramp", list(colors))
    return LineCollection(
        pieces.tolist(), array=values, cmap=ramp, norm=LogNorm(*limits), linewidths=1.6, capstyle="round"
    )


def snapshots(times: Array, positions: Array, instants: Sequence[float], traces: bool = True) -> Figure:
    """Poses of an arm at `instants`, a panel each, with the way each joint has come.

    times: (T,) [s].  positions: (T, n + 1, 2) [m], base, joints and tip.
    """
    with style():
        reach = 1.08 * np.abs(positions[..., 0]).max()
        low, high = positions[..., 1].min() - 0.15 * reach, positions[..., 1].max() + 0.15 * reach
        columns = -(-len(instants) // 2)
        panel = 9.0 / columns  # inches; equal scales fix the height
        figure = empty_figure(9.0, 2 * (0.86 * panel * (high - low) / (2 * reach) + 0.42) + 0.3)
        axes = figure.subplots(2, columns, sharex=True, sharey=True)
        for letter, (axis, instant) in zip("abcdefghijkl", zip(axes.flat, instants, strict=False), strict=False):
            row = int(np.abs(times - instant).argmin())
            for joint in range(1, positions.shape[1]):
                color = theme.LINKS[(joint - 1) % len(theme.LINKS)]
                if traces:
                    axis.plot(*positions[: row + 1, joint].T, color=color, linewidth=0.9, alpha=0.55)
                axis.plot(*positions[row, joint - 1 : joint + 1].T, color=color, linewidth=5, solid_capstyle="round")
            axis.plot(*positions[row, :-1].T, "o", color="white", markeredgecolor=theme.TEXT, markersize=4.5)
            axis.set_title(f"({letter})  t = {times[row]:.1f} s", fontsize=10, loc="left")
            axis.set_aspect("equal")
            axis.set_xlim(-reach, reach)
            axis.set_ylim(low, high)
            axis.grid(**GRID)
        for axis in axes[-1]:
            axis.set_xlabel("x [m]")
        for axis in axes[:, 0]:
            axis.set_ylabel("y [m]")
    return figure


def images(pictures: Sequence[Array], titles: Sequence[str]) -> Figure:
    """Pictures, (height, width, 3) each, in two rows under their titles."""
    with style():
        shape = pictures[0].shape
        figure = empty_figure(9.0, 2 * (9.0 / -(-len(pictures) // 2) * shape[0] / shape[1] + 0.3))
        for axis, picture, title in zip(figure.subplots(2, -(-len(pictures) // 2)).flat, pictures, titles, strict=True):
            axis.imshow(picture)
            axis.set_title(title, fontsize=10, loc="left")
            axis.set_axis_off()
    return figure


def bars(groups: Mapping[str, Mapping[str, tuple[float, float]]], colors: Mapping[str, str]) -> Figure:
    """Means with standard deviations, {panel: {bar: (mean, deviation)}}, a panel with its own scale for each group.

    colors: {bar: color}.
    """
    with style():
        figure = empty_figure(9.0, 3.6)
        for axis, (title, values) in zip(
            np.atleast_1d(figure.subplots(1, len(groups))).flat, groups.items(), strict=True
        ):
            means = [mean for mean, _ in values.values()]
            drawn = axis.bar(
                range(len(values)),
                means,
                yerr=[[min(mean, deviation) for mean, deviation in values.values()], [d for _, d in values.values()]],
                color=[colors[name] for name in values],
                error_kw={"elinewidth": 1, "capsize": 3, "ecolor": theme.TEXT},
                width=0.62,
            )
            for label in axis.bar_label(drawn, [f"{mean:.3g}" for mean in means], label_type="center"):
                label.set_bbox({"facecolor": "white", "edgecolor": "none", "boxstyle": "round,pad=0.2"})
            axis.set_xticks(range(len(values)), [name.replace(" ", "\n", 1) for name in values])
            axis.set_title(title, fontsize=10, loc="left")
            axis.set_ylim(bottom=0)
    return figure


Curves = Mapping[str, tuple[Sequence[float], Sequence[float]]]  # {name: (x, y)}


def powers(
    panels: Mapping[str, Curves], x: str, y: Sequence[str], kinds: int = 1, colors: Mapping[str, str] | None = None
) -> Figure:
    """Curves on logarithmic axes, {panel: curves}; zeros are left out. One legend serves all panels.

    kinds: curves come in groups of so many, one color a group and one line style a place in the group.
    colors: {curve: color} in place of a color for each group.
    """
    with style():
        figure = empty_figure(9.0, 3.9)
        axes = np.atleast_1d(figure.subplots(1, len(panels)))
        labels: dict[str, Any] = {}
        for axis, label, (title, curves) in zip(axes.flat, y, panels.items(), strict=True):
            for number, (name, (at, values)) in enumerate(curves.items()):
                kept = [(a, b) for a, b in zip(at, values, strict=True) if b > 0]
                if kept:
                    (labels[name],) = axis.loglog(
                        *zip(*kept, strict=True),
                        marker="osD^v"[number // kinds % 5],
                        markersize=4,
                        linestyle=("-", "--", ":")[number % kinds],
                        color=colors[name] if colors else theme.SERIES[number // kinds % len(theme.SERIES)],
                        label=name,
                    )
            axis.set_title(title, fontsize=10, loc="left")
            axis.set_xlabel(x)
            axis.set_ylabel(label)
            axis.grid(**GRID)
        figure.legend(
            labels.values(), labels.keys(), loc="outside lower center", ncols=min(4, len(labels)), frameon=False
        )
    return figure
