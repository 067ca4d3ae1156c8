"""Graphs by depth: a row for each length of the longest way from the leaves, as nodes and lines, or as silhouettes."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from types import MappingProxyType

from cgraph import Graph, Node
from cgraph._shared import columns, counted

from .. import theme

RING = 5.0  # pixels by which the ring of an output is wider than its node
SWEEPS = 8  # over all rows, to bring nodes near their neighbors
HEAD, FOOT, SIDE, FONT = 46.0, 12.0, 40.0, 13  # pixels above and below the rows and between panels, and of letters
Place = tuple[float, float]


@dataclass(frozen=True)
class Scale:
    """Pixels from row to row and from node to node, and a node's width and height.  ticks: rows between numbers.

    names: {name of an input or output: text shown}; without any, nodes have no texts.
    """

    row: float
    gap: float
    width: float
    height: float
    ticks: int = 1
    names: Mapping[str, str] = field(default_factory=dict)

    def y(self, level: float, depth: int) -> float:
        """The height of a row in a picture of so many rows, downward."""
        return HEAD + (depth - level + 0.5) * self.row


def levels_of(graph: Graph) -> dict[Node, int]:
    """{node: operations on the longest way to it}, as `Graph.counts` measures depth."""
    level: dict[Node, int] = {}
    for node in graph.nodes:  # arguments come before their use
        level[node] = 1 + max([level[arg] for arg in node.args]) if node.args else 0
    return level


def longest_way(graph: Graph) -> list[Node]:
    """One of the longest ways, from a leaf up."""
    level = levels_of(graph)
    way = [max(graph.outputs.values(), key=level.__getitem__)]
    while way[-1].args:
        way.append(max(way[-1].args, key=level.__getitem__))
    return way[::-1]


def levels_svg(
    graphs: Mapping[str, Graph], scale: Scale, marks: Mapping[str, Mapping[str, int]] = MappingProxyType({})
) -> str:
    """{title: graph} side by side, leaves at the bottom, a longest way thick.  Dark as `to_adaptive` makes it.

    Lines from constants are left out, those from inputs are faint.
    marks: {title: {words: level}} of the lines across a graph that say what is there.
    """
    depth = max([graph.counts().depth for graph in graphs.values()])
    drawn, x = list[str](), SIDE
    for title, graph in graphs.items():
        offsets, width = _across(graph, scale)
        size = graph.counts()
        sizes = f"{counted(size.nodes, 'node')}, {counted(size.edges, 'edge')}, {size.depth} deep, {size.width} wide"
        heading, width = _heading(title, sizes, x, 14.0, width)
        drawn += heading
        for words, level in marks.get(title, {}).items():
            y = scale.y(level, depth)
            drawn += [_rule(x, x + width, y, 'stroke-dasharray="5 4"'), _label(x, y - 5, words, "start")]
        at = {node: (x + left, scale.y(level, depth)) for node, (left, level) in offsets.items()}
        drawn += [*_lines(graph, at), *_nodes(graph, at, scale)]
        x += width + SIDE
    heights = {level: scale.y(level, depth) for level in range(0, depth + 1, scale.ticks)}
    return _with_rows(x - SIDE, heights, scale.y(0, depth) + scale.row / 2, drawn)


def _with_rows(right: float, heights: Mapping[int, float], bottom: float, drawn: Sequence[str]) -> str:
    """The picture, with lines and numbers of its rows.  heights: {level: pixels from the top}."""
    rows = []
    for level, y in heights.items():
        rows += [_rule(SIDE - 10, right, y, 'stroke-opacity="0.2"'), _label(SIDE - 14, y + 4, str(level), "end")]
    width, height = right + 8, bottom + FOOT
    return (
        f'<svg width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'xmlns="http://www.w3.org/2000/svg"><g class="graph" font-family="{theme.FONT_FAMILIES}" font-size="{FONT}" '
        f'fill="{theme.TEXT}"><polygon fill="white" stroke="none" points="0,0 0,{height:.0f} {width:.0f},{height:.0f} '
        f'{width:.0f},0"/>{"".join([*rows, *drawn])}</g></svg>\n'
    )


def _across(graph: Graph, scale: Scale) -> tuple[dict[Node, tuple[float, int]], float]:
    """{node: (pixels from the left, level)}, near its neighbors, and the width."""
    level = levels_of(graph)
    near: dict[Node, list[Node]] = {node: [] for node in level}
    for edge in graph.edges:
        if edge.source.value is None:
            near[edge.source].append(edge.target)
            near[edge.target].append(edge.source)
    rows: list[list[Node]] = [[] for _ in range(max(level.values()) + 1)]
    for node, k in level.items():
        rows[k].append(node)
    at: dict[Node, float] = {}
    for row in rows:
        _spread(at, row, [0.0] * len(row), scale.gap)
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 else rows[::-1]:
            wish = {node: sum([at[each] for each in near[node]]) / len(near[node]) if near[node] else at[node]
                    for node in row}  # fmt: skip
            row.sort(key=wish.__getitem__)
            _spread(at, row, [wish[node] for node in row], scale.gap)
    left = min(at.values()) - scale.width / 2
    return {node: (x - left, level[node]) for node, x in at.items()}, max(at.values()) + scale.width / 2 - left


def _spread(at: dict[Node, float], row: Sequence[Node], wish: Sequence[float], gap: float) -> None:
    """Put the nodes of a row, in order, where they wish to be, as far as they stay a gap apart: by pooling."""
    pools: list[tuple[float, int]] = []  # the mean wish for the left end of nodes that touch, and how many they are
    for i, place in enumerate(wish):
        mean, size = place - i * gap, 1
        while pools and pools[-1][0] >= mean:
            other, others = pools.pop()
            mean, size = (mean * size + other * others) / (size + others), size + others
        pools.append((mean, size))
    starts = [mean for mean, size in pools for _ in range(size)]
    at |= {node: start + i * gap for i, (node, start) in enumerate(zip(row, starts, strict=True))}


def _heading(title: str, sizes: str, x: float, y: float, width: float) -> tuple[list[str], float]:
    """Title and sizes of a panel, and its width with them."""
    texts = [_label(x, y, title, "start", 'font-weight="bold"'), _label(x, y + 17, sizes, "start")]
    return texts, max([width, *[0.62 * FONT * len(text) for text in (title, sizes)]])


def _lines(graph: Graph, at: Mapping[Node, Place]) -> list[str]:
    thick = [*pairwise(longest_way(graph))]
    thin = [(edge.source, edge.target) for edge in graph.edges if edge.source.value is None]
    faint = [_curve(at[a], at[b], 1.0, 0.55 if a.args else 0.25) for a, b in thin if (a, b) not in thick]
    return [*faint, *[_curve(at[a], at[b], 3.0, 1.0) for a, b in thick]]


def _nodes(graph: Graph, at: Mapping[Node, Place], scale: Scale) -> list[str]:
    outputs: dict[Node, list[str]] = {}
    for name, node in graph.outputs.items():
        outputs.setdefault(node, []).append(scale.names.get(name, theme.pretty(name)))
    parts = []
    for node, (x, y) in at.items():
        paint, w, h = theme.ROLES[theme.role_of(node)], scale.width, scale.height
        if node in outputs:  # a ring around it, which leaves its color to be seen
            ring = f'fill="none" stroke="{theme.LINE.lower()}"'
            parts.append(f'<rect class="ring" {_around(x, y, w + RING, h + RING, node)} {ring}/>')
        look = f'fill="{paint.fill}" stroke="{paint.line}" stroke-width="1.2"'
        parts.append(f"<rect {_around(x, y, w, h, node)} {look}/>")
        if scale.names:
            number = "" if node.value is None else f"{node.value:.3g}"
            text = columns(node.op).symbol if node.args else number or scale.names.get(str(node.name), str(node.name))
            parts.append(f'<g class="node">{_label(x, y + 4, text, "middle")}</g>')
            parts += [_label(x, y - h / 2 - 6, " = ".join(outputs[node]), "middle")] if node in outputs else []
    return parts


def _around(x: float, y: float, width: float, height: float, node: Node) -> str:
    """Place and corners of a node's shape: round where it is computed."""
    corner = height / 2 if node.args else 2.0
    return (
        f'x="{x - width / 2:.1f}" y="{y - height / 2:.1f}" width="{width:.1f}" height="{height:.1f}" rx="{corner:.1f}"'
    )


def _curve(start: Place, end: Place, thickness: float, strength: float) -> str:
    (x, y), (to_x, to_y) = start, end
    bend = (y - to_y) / 2
    return (
        f'<path d="M{x:.1f} {y:.1f}C{x:.1f} {y - bend:.1f} {to_x:.1f} {to_y + bend:.1f} {to_x:.1f} {to_y:.1f}" '
        f'fill="none" stroke="{theme.LINE.lower()}" stroke-width="{thickness}" stroke-opacity="{strength}"/>'
    )


def _rule(left: float, right: float, y: float, look: str) -> str:
    return f'<path d="M{left:.1f} {y:.1f}H{right:.1f}" stroke="{theme.LINE.lower()}" {look}/>'


def _label(x: float, y: float, text: str, anchor: str, look: str = "") -> str:
    """A text; anchor: which end of it is at x."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {look}>{escape(text)}</text>'


TICKS = 100  # levels between numbers


def silhouettes_svg(graphs: Mapping[str, Graph], row: float = 1.0, node: float = 1.0) -> str:
    """{title: graph} side by side, leaves at the bottom, the same rows for all; nodes of a row by their colors.

    row, node: pixels of a level and of a node across.  Dark as `to_adaptive` makes it.
    """
    depth = max([graph.counts().depth for graph in graphs.values()])

    def y(level: float) -> float:
        return HEAD + (depth - level) * row

    drawn, x = list[str](), SIDE
    for title, graph in graphs.items():
        counts = graph.counts()
        sizes = f"{counted(counts.nodes, 'node')}, {counts.depth} deep"
        heading, width = _heading(title, sizes, x, y(counts.depth) - 24, node * counts.width)
        drawn += heading
        for paint, path in _rows(graph, x, node).items():
            rows = "".join(
                [f"M{left:.1f} {y(k + 0.5):.1f}h{wide:.1f}v{row:.1f}h{-wide:.1f}z" for k, left, wide in path]
            )
            drawn.append(f'<path d="{rows}" fill="{paint.line}"/>')
        x += width + SIDE
    return _with_rows(x - SIDE, {level: y(level) for level in range(0, depth + 1, TICKS)}, y(0), drawn)


def _rows(graph: Graph, x: float, node: float) -> dict[theme.Paint, list[tuple[int, float, float]]]:
    """{color: (level, left end, width) of its bar on every level that has it}."""
    sizes = Counter([(level, theme.role_of(each)) for each, level in levels_of(graph).items()])
    bars: dict[theme.Paint, list[tuple[int, float, float]]] = {}
    for level in range(graph.counts().depth + 1):
        left = x
        for role, paint in theme.ROLES.items():
            if wide := node * sizes[level, role]:
                bars.setdefault(paint, []).append((level, left, wide))
                left += wide
    return bars
