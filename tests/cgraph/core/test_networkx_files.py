"""Graphs in the files of networkx: GraphML, GEXF, GML and JSON give back the same graph."""

import io
import json
import math
from collections.abc import Callable, Iterator
from typing import Any

import networkx as nx
import pytest
from hypothesis import given, settings

import cgraph as cg
from tests.strategies import cases, examples


def through_files(graph: cg.Graph) -> Iterator[tuple[str, nx.DiGraph]]:
    """(format, what networkx reads of its own file) of every format."""
    network = cg.to_networkx(graph)
    for name, write, read in (("GraphML", nx.write_graphml, nx.read_graphml), ("GEXF", nx.write_gexf, nx.read_gexf)):
        file = io.BytesIO()
        write(network, file)
        yield name, read(io.BytesIO(file.getvalue()))
    yield "GML", nx.parse_gml("\n".join(nx.generate_gml(network)))
    text = json.dumps(nx.node_link_data(network, edges="edges"))
    yield "JSON", nx.node_link_graph(json.loads(text), edges="edges")
    yield "Cytoscape", nx.cytoscape_graph(json.loads(json.dumps(nx.cytoscape_data(network))))


def labels(graph: cg.Graph) -> list[tuple[Any, ...]]:
    return [(node.name, node.tags, node.roles, node.lines) for node in graph.nodes]


def same(graph: cg.Graph) -> list[str]:
    """The formats that do not give it back, with all that its nodes are called."""
    return [
        name
        for name, network in through_files(graph)
        if (again := cg.from_networkx(network)).listing() != graph.listing()
        or cg.structure_hash(again) != cg.structure_hash(graph)
        or labels(again) != labels(graph)
    ]


@settings(max_examples=examples(40))
@given(cases())
def test_a_random_graph_and_its_derivative_come_back(case) -> None:
    assert same(case.graph) == same(cg.vjp(case.graph)) == []


def test_names_places_lines_and_the_last_bit_of_constants_come_back() -> None:
    x, y, unused = cg.variables("x y θ")
    with cg.tag("a <b> & 'c', \"ü\"", "link 2"), cg.recording_lines():
        total = x * x + y * cg.constant(-0.0)
        for value in (math.inf, -math.inf, 0.1, 1e-300, 5e-324, 1.7976931348623157e308, 1e22):
            total = total + cg.constant(value) * x
    total = cg.with_name(total, " two  spaces ")
    graph = cg.Graph([y, unused, x], {"z": total, "b": x, "q 2": total, "c": total / 3.0})
    assert same(graph) == []


def spoilt(change: Callable[[nx.MultiDiGraph], object]) -> nx.MultiDiGraph:
    """x * y, with a change."""
    x, y = cg.variables("x y")
    network = cg.to_networkx(cg.Graph([x, y], {"f": 2.0 * x - y}))  # 0: constant, 1: x, 2: mul, 3: y, 4: sub
    change(network)
    return network


WRONG = {
    "has no attribute 'op'": lambda net: net.nodes[1].pop("op"),
    "has no attribute 'number'": lambda net: net.nodes[0].pop("number"),
    "attribute 'number' of node 0, 'two', cannot be read": lambda net: net.nodes[0].update(number="two"),
    "attribute 'tags' of node 2, 'link', cannot be read": lambda net: net.nodes[2].update(tags="link"),
    "operation 'times' of node 2 is not in the table": lambda net: net.nodes[2].update(op="times"),
    "node 4, sub, takes 2 arguments in slots from 0, got [0]": lambda net: net.remove_edge(3, 4),
    "has no attribute 'slot'": lambda net: net.edges[3, 4, 1].pop("slot"),
    "the arguments of a node lead back to it": lambda net: net.add_edge(4, 2, slot=0),
    "a graph needs at least one output": lambda net: net.nodes[4].pop("outputs"),
}


def test_a_constant_is_read_from_value_where_files_before_have_it() -> None:
    old = spoilt(lambda net: net.nodes[0].update(value=net.nodes[0].pop("number")))
    assert cg.from_networkx(old).evaluate({"x": 3.0, "y": 1.0}) == {"f": 5.0}


def test_what_is_missing_or_wrong_is_told() -> None:
    for words, change in WRONG.items():
        with pytest.raises(cg.GraphError) as error:
            cg.from_networkx(spoilt(change))
        assert words in str(error.value)
