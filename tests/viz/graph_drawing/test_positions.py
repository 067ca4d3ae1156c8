"""Where Graphviz puts shapes: every line leads up, nothing overlaps, several drawings do not mix."""

import re
from itertools import combinations

import pytest

import viz.graph_drawing.render as module
from viz.graph_drawing.render import RenderError, positions

BOXES = ((50.0, 34.0), (90.0, 30.0), (58.0, 34.0), (46.0, 30.0))
DIAMOND = ((0, 1), (0, 2), (1, 3), (2, 3))


def test_lines_lead_up_from_shape_to_shape_and_nothing_overlaps():
    chain = ((40.0, 20.0),) * 2, ((0, 1),)
    first, second = positions((BOXES, DIAMOND), chain)
    assert second.lines.keys() == {(0, 1)}
    for (sizes, lines), found in zip([(BOXES, DIAMOND), chain], (first, second), strict=True):
        boxes = [
            (x - w / 2, y - h / 2, x + w / 2, y + h / 2) for (x, y), (w, h) in zip(found.centers, sizes, strict=True)
        ]
        for a, b in combinations(boxes, 2):
            assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert all(x0 >= 0 and y0 >= 0 and x1 <= found.size[0] and y1 <= found.size[1] for x0, y0, x1, y1 in boxes)
        for source, target in lines:
            assert found.centers[source][1] > found.centers[target][1]
            numbers = [float(each) for each in re.findall(r"-?[0-9.]+", found.lines[source, target])]
            assert numbers[1] == pytest.approx(boxes[source][1], abs=1.0)  # from the top of the one
            assert numbers[-3] == pytest.approx(boxes[target][3], abs=1.0)  # to the foot of the other
            assert boxes[target][0] <= numbers[-4] <= boxes[target][2]


def test_without_graphviz_the_page_places_nodes_itself(monkeypatch):
    import cgraph as cg
    from viz.inspector import Version
    from viz.inspector.record import record

    x = cg.variable("x")
    versions = [Version("v", cg.Graph([x], {"y": cg.sin(x) * 3.0}))]
    drawn = record(versions, None)["versions"][0]["drawing"]
    assert [bool(each) for each in drawn["nodes"]] == [True, True, False, True]  # a constant is in the text of its use
    assert set(drawn["lines"]) == {"n0 n1", "n1 n3", "n3 oy"}

    def broken(source, **options):
        raise RenderError("none")

    module.positions.cache_clear()
    monkeypatch.setattr(module, "render_svg", broken)
    assert record(versions, None)["versions"][0]["drawing"] is None
