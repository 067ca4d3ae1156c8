"""Where Graphviz puts shapes of given sizes and the lines between them, without drawing any."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from cgraph.extend import memo

from .render import render_svg

POINTS = 72.0  # in an inch, the unit of Graphviz; a point of its SVG is a pixel here
HEAD = 7.0  # length of an arrowhead, pixels
_SVG = "{http://www.w3.org/2000/svg}"
_NUMBER = re.compile(r"-?[0-9.]+(?:e-?[0-9]+)?")

Size = tuple[float, float]
Line = tuple[int, int]


class Positions(NamedTuple):
    """Centers of shapes in pixels, y downward; lines as SVG paths with their arrowheads; the size of the whole."""

    centers: Sequence[Size]
    lines: Mapping[Line, str]
    size: Size


def positions(drawings: Sequence[tuple[Sequence[Size], Sequence[Line]]]) -> list[Positions]:
    """Layered drawings, each of shapes (width, height) in pixels and lines that lead upward, in one run of Graphviz.

    Raises RenderError where there is no Graphviz, or it fails.
    """
    return list(_positions(tuple((tuple(sizes), tuple(lines)) for sizes, lines in drawings)))


@memo(64)
def _positions(drawings: tuple[tuple[tuple[Size, ...], tuple[Line, ...]], ...]) -> tuple[Positions, ...]:
    root = ElementTree.fromstring(render_svg(_dot(drawings), timeout=20.0))  # noqa: S314 (Graphviz's own text)
    shapes = {group.get("id", ""): group for group in root.iter(f"{_SVG}g")}
    return tuple(_read(shapes, k, *drawing) for k, drawing in enumerate(drawings))


def _dot(drawings: Sequence[tuple[Sequence[Size], Sequence[Line]]]) -> str:
    """One graph with a cluster for each drawing, which keeps them apart."""
    text = ['digraph { rankdir=BT; ranksep=0.38; nodesep=0.16; edge [arrowhead=none]; node [fixedsize=true, label=""]']
    for k, (sizes, lines) in enumerate(drawings):
        text.append(f"subgraph cluster_{k} {{ id=d{k}; margin=8")
        for i, (width, height) in enumerate(sizes):
            text.append(f"d{k}n{i} [id=d{k}n{i}, shape=box, width={width / POINTS:.4f}, height={height / POINTS:.4f}]")
        text += [f"d{k}n{source} -> d{k}n{target} [id=d{k}e{source}_{target}]" for source, target in lines]
        text.append("}")
    return "\n".join([*text, "}"])


def _read(shapes: Mapping[str, ElementTree.Element], k: int, sizes: Sequence[Size], lines: Sequence[Line]) -> Positions:
    left, top, right, bottom = _extent(shapes[f"d{k}"])
    centers = []
    for i in range(len(sizes)):
        x0, y0, x1, y1 = _extent(shapes[f"d{k}n{i}"])
        centers.append((round((x0 + x1) / 2 - left, 1), round((y0 + y1) / 2 - top, 1)))
    paths = {}
    for source, target in lines:
        path = shapes[f"d{k}e{source}_{target}"].find(f"{_SVG}path")
        assert path is not None
        flat = [float(number) for number in _NUMBER.findall(path.get("d", ""))]
        moved = [(x - left, y - top) for x, y in zip(flat[::2], flat[1::2], strict=True)]
        paths[source, target] = _with_head(moved)
    return Positions(centers, paths, (round(right - left, 1), round(bottom - top, 1)))


def _extent(group: ElementTree.Element) -> tuple[float, float, float, float]:
    """Left, top, right and bottom of a box."""
    polygon = group.find(f"{_SVG}polygon")
    assert polygon is not None
    flat = [float(number) for number in _NUMBER.findall(polygon.get("points", ""))]
    return min(flat[::2]), min(flat[1::2]), max(flat[::2]), max(flat[1::2])


def _with_head(points: Sequence[Size]) -> str:
    """A curve of Bezier's, M p C p p p .., with an open arrowhead along its end."""
    (x, y), end = points[0], points[-1]
    before = next((point for point in reversed(points[:-1]) if point != end), (end[0], end[1] + 1.0))
    length = ((end[0] - before[0]) ** 2 + (end[1] - before[1]) ** 2) ** 0.5
    a, b = (end[0] - before[0]) / length, (end[1] - before[1]) / length
    feet = [(end[0] - HEAD * a + s * 0.55 * HEAD * b, end[1] - HEAD * b - s * 0.55 * HEAD * a) for s in (1.0, -1.0)]
    curve = " ".join([_text(point) for point in points[1:]])
    return f"M{x:.1f} {y:.1f}C{curve}M{_text(feet[0])}L{_text(end)}L{_text(feet[1])}"


def _text(point: Size) -> str:
    return f"{point[0]:.1f} {point[1]:.1f}"
