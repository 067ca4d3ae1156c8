"""Why an output depends on an input: against every path walked one by one, and derivatives at 50 digits."""

import json
import math

import pytest
from hypothesis import assume, given, settings

import cgraph as cg
from cgraph import why, why_not
from tests.each_row import each_row
from tests.strategies import Case, cases, examples
from tests.tolerances import EQUATIONS, SUMS

x, y, z = cg.variables("x y z")


def walked(source: cg.Node, sink: cg.Node) -> list[list[cg.Edge]]:
    """Every path, by walking it: for small graphs only."""
    if sink is source:
        return [[]]
    return [[*path, cg.Edge(arg, sink, slot)] for slot, arg in enumerate(sink.args) for path in walked(source, arg)]


def product(graph: cg.Graph, path: list[cg.Edge], values: dict[str, float]) -> float:
    partials = cg.Graph(graph.inputs, {str(i): edge.partial for i, edge in enumerate(path)} | {"one": 1.0})
    slopes = partials.evaluate(values)
    result = 1.0
    for slope in slopes.values():
        result = 0.0 if slope == 0.0 or result == 0.0 else result * slope  # behind a zero there may be infinity
    return result


@settings(max_examples=examples(150))
@given(cases(max_operations=10, max_outputs=1))
def test_every_path_is_counted_weighed_and_listed_in_order(case: Case):
    (output,) = case.graph.outputs.values()
    for node in case.graph.inputs:
        paths = walked(node, output)
        assume(len(paths) < 300)
        found = why(case.graph, "f0", str(node.name), case.values, k=len(paths))
        assert found.count == len(paths)
        values = [product(case.graph, path, case.values) for path in paths]
        heaviest = sorted((abs(value) for value in values if value), reverse=True)
        assert [abs(path.value) for path in found.paths] == pytest.approx(heaviest, rel=SUMS)
        assert {path.edges for path in found.paths} == {
            tuple(path) for path, value in zip(paths, values, strict=True) if value
        }
        assert found.weight == pytest.approx(math.fsum(heaviest), rel=SUMS)
        assert found.derivative == pytest.approx(math.fsum(values), rel=SUMS, abs=EQUATIONS * (1.0 + found.weight))
        few = why(case.graph, "f0", str(node.name), case.values, k=2)
        assert [abs(path.value) for path in few.paths] == pytest.approx(heaviest[:2], rel=SUMS)
        shortest = why(case.graph, "f0", str(node.name), k=len(paths))
        assert [len(path.edges) for path in shortest.paths] == sorted(map(len, paths))
        for told in (found, shortest):  # no two of them read the same
            assert not any("[]" in path.text for path in told.paths)  # nor has any an empty list of tags
            assert len({path.text for path in told.paths}) == len(told.paths)


def test_paths_are_told_by_names_and_tags():
    with cg.tag("spring"):
        force = cg.with_name(3.0 * x, "force")
    graph = cg.Graph([x, y], {"power": force * y + cg.sin(x)})
    assert str(why(graph, "power", "x", {"x": 0.0, "y": 0.25})) == (
        "power depends on x along 2 paths.\n"
        "d power / d x = 1.75, the sum over all of them.\n"
        "     +1  x -> sin(x) -> power\n"
        "  +0.75  x -> force -> force * y -> power  [spring]\n"
        "These are all."
    )
    assert str(why(graph, "power", "x", {"x": 0.0, "y": 0.25}, k=1)).endswith("carry 57.1% of the weight of all.")


def test_a_square_is_two_paths_and_an_output_may_be_its_input():
    graph = cg.Graph([x], {"f": x * x, "g": x})
    assert [path.value for path in why(graph, "f", "x", {"x": 3.0}).paths] == [3.0, 3.0]
    itself = why(graph, "g", "x", {"x": 3.0})
    assert (itself.count, itself.derivative, [path.edges for path in itself.paths]) == (1, 1.0, [()])


@each_row(
    ("depth", "slope", "share", "words"),
    [(100, 2.0**100, 2 / 2.0**100, "1.27e+30 paths"), (10_000, math.inf, None, "2e+3010 paths")],
)
def test_numbers_of_paths_are_exact_however_large_and_deep_graphs_need_no_recursion(depth, slope, share, words):
    node = x
    for _ in range(depth):
        node = node + node
    found = why(cg.Graph([x], {"f": node}), "f", "x", {"x": 1.0}, k=2)
    assert (found.count, found.derivative, found.weight, found.share) == (2**depth, slope, slope, share)
    assert words in str(found)
    json.dumps(found.to_dict(), allow_nan=False)


def test_a_named_node_inside_is_an_input_or_an_output_too():
    radius = cg.with_name(cg.hypot(x, y), "radius")
    graph = cg.Graph([x, y], {"f": radius * radius, "g": cg.exp(radius)})
    assert why(graph, "f", "radius", {"x": 3.0, "y": 4.0}).derivative == 10.0
    assert why(graph, radius, "x", {"x": 3.0, "y": 4.0}).derivative == pytest.approx(0.6)
    assert why(graph, "radius", x, {"x": 3.0, "y": 4.0}).derivative == pytest.approx(0.6)


def test_the_branch_not_taken_weighs_nothing():
    graph = cg.Graph([x], {"f": cg.where(x > 0.0, cg.sqrt(x), -x)})
    for at in (-1.0, 0.0):
        found = why(graph, "f", "x", {"x": at})
        assert (found.count, found.derivative, len(found.paths)) == (3, -1.0, 1)
    with pytest.raises(cg.GraphError, match=r"derivative of %1 = sqrt\(x\) by x is inf here"):
        why(cg.Graph([x], {"f": cg.sqrt(x)}), "f", "x", {"x": 0.0})


@each_row(
    ("arguments", "error", "words"),
    [
        (("h", "x"), cg.GraphError, r"is called 'h' \(inputs x, y, z; named nodes a; outputs f, g\)"),
        (("f", "w"), cg.GraphError, "nothing in the graph is called 'w'"),
        (("f", cg.variable("strange")), cg.GraphError, "<node variable strange> is not a node of the graph"),
        (("f", "x", {"x": 1.0}), cg.GraphError, "at: no value for input y, z"),
        (("f", "x", {"x": math.nan, "y": 0.0, "z": 0.0}), ValueError, "input 'x' must be a finite number, got nan"),
        (("f", "x", {"x": "1", "y": 0.0, "z": 0.0}), ValueError, "input 'x' must be a finite number, got '1'"),
        (("f", "x", dict.fromkeys("xyzw", 1.0)), cg.GraphError, "at: the graph has no input w"),
        (("f", "a"), cg.GraphError, "2 nodes are called 'a'; give the node itself"),
    ],
)
def test_wrong_arguments_are_named(arguments, error, words):
    graph = cg.Graph([x, y, z], {"f": cg.with_name(x * y, "a") - cg.with_name(x + y, "a"), "g": y + 1.0})
    with pytest.raises(error, match=words):
        why(graph, *arguments)


def test_why_not_tells_how_far_the_input_reaches_and_where_the_two_meet():
    graph = cg.Graph([x, y, z], {"f": cg.sin(x) * y, "g": cg.cos(y) + 2.0})
    found = why_not(graph, "g", "x")
    assert str(found) == (
        "g does not depend on x.\n"
        "x reaches 2 other nodes, and of the outputs f.\n"
        "g is made from y.\n"
        "The two meet where g does not look: %2 = %1 * y."
    )
    assert found.outputs == ("f",)
    assert found.inputs == ("y",)
    assert found.meetings == (graph.outputs["f"],)
    assert found.reached == {x, graph.outputs["f"], graph.outputs["f"].args[0]}
    assert not found.reached & found.made_from
    json.dumps(found.to_dict(), allow_nan=False)
    first = x * y
    later = cg.Graph([x, y], {"f": first + y + y, "g": y + 0.0})
    assert why_not(later, "g", "x").meetings == (first,)  # and none of those behind it
    assert "Nothing uses z." in str(why_not(graph, "f", "z"))
    assert "x is the output f; no operation uses it." in str(why_not(cg.Graph([x], {"f": x, "g": 1.0}), "g", "x"))
    with pytest.raises(cg.GraphError, match=r"f depends on x; cg\.why lists the paths"):
        why_not(graph, "f", "x")
    assert "f does not depend on z" in str(why(graph, "f", "z", dict.fromkeys("xyz", 1.0)))


@settings(max_examples=examples(100))
@given(cases(max_operations=12))
def test_exactly_one_of_why_and_why_not_has_an_answer(case: Case):
    for output, node in case.graph.outputs.items():
        for name in case.graph.input_names:
            connected = bool(walked(cg.variable(name), node))
            assert bool(why(case.graph, output, name, k=0).count) is connected
            if not connected:
                found = why_not(case.graph, output, name)
                assert not found.reached & found.made_from
                assert all(found.made_from & set(each.args) for each in found.meetings)
