"""Silhouettes of large graphs: a row for each level of depth, as wide as there are nodes on it."""

from __future__ import annotations

from collections.abc import Sequence

from cgraph import Graph
from cgraph.extend import counted

from .. import theme
from .levels import FONT, FOOT, HEAD, SIDE, LevelPanel, label, levels_of, picture, rule

TICKS = 100  # levels between numbers


def silhouettes_svg(panels: Sequence[LevelPanel], row: float = 1.0, node: float = 1.0) -> str:
    """The panels side by side, leaves at the bottom, the same rows for all; nodes of a row by their colors.

    row, node: pixels of a level and of a node across.  Dark as `to_adaptive` makes it.
    """
    depth = max([panel.graph.counts().depth for panel in panels])

    def y(level: float) -> float:
        return HEAD + (depth - level) * row

    drawn, x = list[str](), SIDE
    for panel in panels:
        counts = panel.graph.counts()
        sizes = f"{counted(counts.nodes, 'node')}, {counts.depth} deep"
        width = max(node * counts.width, *[0.62 * FONT * len(text) for text in (panel.title, sizes)])
        top = y(counts.depth) - 24
        drawn += [label(x, top, panel.title, "start", 'font-weight="bold"'), label(x, top + 17, sizes, "start")]
        for paint, path in _rows(panel.graph, x, node).items():
            rows = "".join(
                [f"M{left:.1f} {y(k + 0.5):.1f}h{wide:.1f}v{row:.1f}h{-wide:.1f}z" for k, left, wide in path]
            )
            drawn.append(f'<path d="{rows}" fill="{paint.line}"/>')
        x += width + SIDE
    ticks = []
    for level in range(0, depth + 1, TICKS):
        ticks += [rule(SIDE - 10, x - SIDE, y(level), 'stroke-opacity="0.2"')]
        ticks += [label(SIDE - 14, y(level) + 4, str(level), "end")]
    return picture(x - SIDE + 8, y(0) + FOOT, [*ticks, *drawn])


def _rows(graph: Graph, x: float, node: float) -> dict[theme.Paint, list[tuple[int, float, float]]]:
    """{color: (level, left end, width) of its bar on every level that has it}."""
    paints = list(theme.ROLES.values())
    levels: dict[int, dict[theme.Paint, int]] = {}
    for each, level in levels_of(graph).items():
        paint = theme.ROLES[theme.role_of(each)]
        row = levels.setdefault(level, {})
        row[paint] = row.get(paint, 0) + 1
    bars: dict[theme.Paint, list[tuple[int, float, float]]] = {}
    for level, row in levels.items():
        left = x
        for paint in sorted(row, key=paints.index):
            bars.setdefault(paint, []).append((level, left, node * row[paint]))
            left += node * row[paint]
    return bars
