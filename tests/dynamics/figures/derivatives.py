"""Pictures of derivatives: estimates beside what they estimate, and paths painted by how much depends on a number."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure

from cgraph._shared import Array
from viz import theme
from viz.plots.plot import GRID, empty_figure, style

COLORS = (theme.BLUE, theme.ORANGE, theme.GREEN, theme.PURPLE)  # seen on white and on black
RAMP = (theme.BLUE, theme.PURPLE, theme.ORANGE)  # from little to much, ever lighter, seen on both


@dataclass(frozen=True)
class Dots:
    """Numbers in groups, a mark each.  names: of the groups.  series: {whose: a number a group}.  y: the axis' name."""

    title: str
    names: Sequence[str]
    series: Mapping[str, Sequence[float]]
    y: str
    logarithmic: bool = False


def dots(panels: Sequence[Dots]) -> Figure:
    """Panels of numbers side by side in groups. One legend serves all; a series has the same color in each."""
    with style():
        figure = empty_figure(7.0, 3.2)
        names = list(dict.fromkeys(name for panel in panels for name in panel.series))
        handles = {}
        for axis, panel in zip(np.atleast_1d(figure.subplots(1, len(panels))).flat, panels, strict=True):
            groups = np.arange(len(panel.names))
            for name, values in panel.series.items():
                k = names.index(name)
                places = groups + 0.8 * ((k + 0.5) / len(names) - 0.5)
                color = COLORS[k] if k < len(COLORS) else theme.TEXT
                (handles[name],) = axis.plot(places, values, "osD^v"[k % 5], color=color, markersize=5, label=name)
            if panel.logarithmic:
                axis.set_yscale("log")
            axis.set_xticks(groups, panel.names)
            axis.set_title(panel.title, fontsize=10, loc="left")
            axis.set_ylabel(panel.y)
            axis.grid(axis="y", **GRID)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, frameon=False)
    return figure


def painted_line(points: Array, values: Array, limits: tuple[float, float], colors: Sequence[str]) -> LineCollection:
    """A line whose pieces are painted by their values, on a logarithmic scale from the first color to the last.

    points: (T, 2).  values: (T - 1,), positive.
    """
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    ramp = LinearSegmentedColormap.from_list("ramp", list(colors))
    return LineCollection(
        pieces.tolist(), array=values, cmap=ramp, norm=LogNorm(*limits), linewidths=1.6, capstyle="round"
    )


def painted_paths(path: Array, t: Array, values: Mapping[str, Array], label: str) -> Figure:
    """One path painted by a quantity in a panel for each of its names, and the quantities over time below.

    path: (T, 2) [m], to the right and up.  t: (T,) [s].  values: {name: (T,)}, positive; scales are logarithmic.
    """
    with style():
        figure = empty_figure(7.0, 4.2)
        grid = figure.add_gridspec(2, len(values), height_ratios=(1.0, 1.2))
        everything = np.concatenate(list(values.values()))
        limits = float(np.quantile(everything, 0.05)), float(everything.max())
        panels = []
        for k, (name, size) in enumerate(values.items()):
            axis = figure.add_subplot(grid[0, k])
            painted = painted_line(path, np.sqrt(size[1:] * size[:-1]), limits, RAMP)
            axis.add_collection(painted)
            axis.plot(0.0, 0.0, "+", color=theme.TEXT)
            axis.autoscale_view()
            axis.set_aspect("equal")
            axis.set_title(name, fontsize=10, loc="left")
            axis.set_xlabel("x [m]")
            axis.grid(**GRID)
            panels.append(axis)
        panels[0].set_ylabel("z [m]")
        figure.colorbar(painted, ax=panels, label=label, pad=0.01)
        axis = figure.add_subplot(grid[1, :])
        for color, (name, size) in zip(COLORS, values.items(), strict=False):
            axis.semilogy(t, size, color=color, linewidth=1.4, label=name)
        axis.set_xlabel("t [s]")
        axis.set_ylabel(label)
        axis.grid(**GRID)
        axis.legend(frameon=False, ncols=len(values), loc="lower right")
    return figure
