"""Drawings by depth: rows are depths, the same for all panels, and nothing overlaps."""

import re
from itertools import pairwise

import pytest

import cgraph as cg
import dynamics as dyn
from tests.each_row import each_row
from viz.graph_drawing.levels import Scale, levels_of, levels_svg, longest_way, silhouettes_svg

SCALE = Scale(row=15.0, gap=13.0, width=8.0, height=8.0, ticks=5)
GRAPHS = {
    "arm": dyn.hamilton_equations(dyn.scenes.load("triple_pendulum")),
    "spring": dyn.state_equation(dyn.scenes.load("spring_mass")),
    "leaf": cg.Graph([cg.variable("x")], {"y": cg.variable("x")}),
}


@each_row("name", GRAPHS)
def test_the_longest_way_has_an_operation_at_every_depth(name: str) -> None:
    graph = GRAPHS[name]
    level, way = levels_of(graph), longest_way(graph)
    assert [level[node] for node in way] == [*range(graph.counts().depth + 1)]
    assert all(a in b.args for a, b in pairwise(way))
    assert all(level[edge.source] < level[edge.target] for edge in graph.edges)


def test_rows_are_depths_alike_in_all_panels_and_no_two_nodes_touch() -> None:
    found = re.findall(r'<rect x="([-0-9.]+)" y="([-0-9.]+)"', levels_svg(GRAPHS, SCALE))
    places = [(float(x), float(y)) for x, y in found]
    assert len(places) == sum(len(graph.nodes) for graph in GRAPHS.values())
    deepest = max(graph.counts().depth for graph in GRAPHS.values())
    expected = [SCALE.y(level, deepest) - 4.0 for graph in GRAPHS.values() for level in levels_of(graph).values()]
    assert sorted(y for _, y in places) == pytest.approx(sorted(expected))
    rows: dict[float, list[float]] = {}
    for x, y in places:
        rows.setdefault(y, []).append(x)
    for row in rows.values():
        row.sort()
        assert all(right - left > SCALE.gap - 0.2 for left, right in pairwise(row))


def test_texts_are_escaped_and_words_stand_at_their_row() -> None:
    x = cg.variable("x<y")
    scale = Scale(row=60.0, gap=60.0, width=40.0, height=30.0, names={"f": "f & g"})
    svg = levels_svg({"a < b": cg.Graph([x], {"f": 2.5 * x})}, scale, {"a < b": {"here": 1}})
    for text in ("a &lt; b", "x&lt;y", "f &amp; g", "2.5", "×", "3 nodes, 2 edges, 1 deep, 2 wide"):
        assert f">{text}</text>" in svg
    assert f'y="{scale.y(1, 1) - 5:.1f}" text-anchor="start" >here</text>' in svg


def test_a_silhouette_has_the_area_of_its_nodes_and_the_height_of_its_depth() -> None:
    svg = silhouettes_svg(GRAPHS, 3.0, 2.0)
    bars = re.findall(r"M([0-9.]+) ([0-9.]+)h([0-9.]+)v3.0h-([0-9.]+)z", svg)
    assert sum(float(wide) for _, _, wide, _ in bars) == 2.0 * sum(len(graph.nodes) for graph in GRAPHS.values())
    heights = {float(y) for _, y, _, _ in bars}
    assert len(heights) == 1 + max(graph.counts().depth for graph in GRAPHS.values())
    assert max(heights) - min(heights) == pytest.approx(3.0 * (len(heights) - 1))
    rows: dict[str, list[tuple[float, float]]] = {}
    for x, y, wide, _ in bars:
        rows.setdefault(y, []).append((float(x), float(x) + float(wide)))
    for row in rows.values():
        row.sort()
        assert all(a[1] <= b[0] + 1e-6 for a, b in pairwise(row))
