"""Reciprocals: the same function with one division for a divisor."""

from collections import Counter

from hypothesis import given, settings

import cgraph as cg
from cgraph.extend import with_reciprocals
from tests import high_precision
from tests.strategies import Case, cases, examples

ROUNDINGS = 4 * 2.0**-53  # relative error of one operation: 4 half ulps


def divisors(graph: cg.Graph) -> Counter[cg.Node]:
    return Counter([node.args[1] for node in graph.nodes if node.op.name == "div" and node.args[1].value is None])


@settings(max_examples=examples(60), deadline=None)
@given(cases())
def test_nothing_is_divided_by_the_same_number_twice(case: Case) -> None:
    graph = cg.Graph(
        case.graph.inputs,
        {f"{k}{name}": (k + y) / (4.0 + y * y) for k in (1, 2) for name, y in case.graph.outputs.items()},
    )
    other = with_reciprocals(graph)
    assert set(divisors(other).values()) <= {1}
    assert len(other.nodes) <= len(graph.nodes) + len(divisors(graph))
    exact = high_precision.evaluate(graph, case.values)
    sizes = [high_precision.rounding_size(each, case.values) for each in (graph, other)]
    for name, found in other.evaluate(case.values).items():
        assert abs(found - exact[name]) <= ROUNDINGS * sum(size[name] for size in sizes)


def test_a_number_that_divides_once_and_a_constant_stay() -> None:
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"a": x / y, "b": x / 3.0, "c": y / 3.0})
    assert [node.op.name for node in with_reciprocals(graph).nodes if node.args] == ["div"] * 3
