"""The difference of two graphs: nothing is lost or counted twice, and it is the same in every run."""

import json
from collections import Counter

import pytest
from hypothesis import given, settings

import cgraph as cg
import dynamics as dyn
from cgraph import compare
from tests.strategies import Case, cases, examples
from viz.models.node_classes import formulation_classes

x, y, z = cg.variables("x y z")


def spelled(node: cg.Node) -> str:
    """The expression of a node in full, arguments that commute sorted: what a digest stands for. Small graphs only."""
    if not node.args:
        return node.name or float(node).hex()
    args = [spelled(arg) for arg in node.args]
    return f"{node.op.name}({', '.join(sorted(args) if node.op.commutative else args)})"


@settings(max_examples=examples(100))
@given(cases(max_operations=10), cases(max_operations=10))
def test_every_node_is_counted_once_and_pairs_are_alike(one: Case, other: Case):
    for left, right in ((one.graph, other.graph), (one.graph, one.graph), (one.graph, cg.simplify(one.graph))):
        found = compare(left, right)
        assert {a for a, _ in found.common} | set(found.only_left) == set(left.nodes)
        assert {b for _, b in found.common} | set(found.only_right) == set(right.nodes)
        assert len(found.common) + len(found.only_left) == len(left.nodes)
        assert len(found.common) + len(found.only_right) == len(right.nodes)
        assert all(spelled(a) == spelled(b) for a, b in found.common)
        lefts, rights = (Counter(map(spelled, graph.nodes)) for graph in (left, right))
        assert len(found.common) == sum((lefts & rights).values())
        for side, only in (("left", found.only_left), ("right", found.only_right)):
            assert sum(found.classes(side).values()) == len(only)


@settings(max_examples=examples(60))
@given(cases(max_operations=12), cases(max_operations=12))
def test_both_graphs_are_in_the_one_of_both(one: Case, other: Case):
    found = compare(one.graph, other.graph)
    both = found.overlay()
    both.graph.check()
    values = {name: (one.values | other.values)[name] for name in both.graph.input_names}
    together = both.graph.evaluate(values)
    for side, graph in (("left", one.graph), ("right", other.graph)):
        for name, value in graph.evaluate({each: values[each] for each in graph.input_names}).items():
            again = together[name if name in found.same_outputs else f"{side} {name}"]
            assert again == value or (again != again and value != value)
    assert not both.only_left & both.only_right
    assert both.only_left | both.only_right <= set(both.graph.nodes)
    kept = len(both.graph.nodes) - len(both.only_left | both.only_right)
    assert kept == len(found.common)


def test_the_summary():
    with cg.tag("spring"):
        left = cg.Graph([x, y], {"f": cg.sin(x) + y, "g": x * y})
    right = cg.Graph([x, y], {"f": cg.sin(x) - y, "g": y * x})
    assert str(compare(left, right)) == (
        "5 nodes left, 5 right: 4 in both, 1 only left, 1 only right.\n"
        "Computed alike: g.\n"
        "Computed otherwise: f.\n"
        "Only left:\n"
        "      1  primal; spring\n"
        "Only right:\n"
        "      1  primal"
    )


def test_copies_are_paired_once_each():
    left = cg.Graph([x], {"f": cg.sin(x) * cg.sin(x), "g": cg.sin(x)})
    right = cg.Graph([x], {"f": cg.sin(x) * cg.sin(x)})
    found = compare(left, right)
    assert (len(found.common), len(found.only_left), len(found.only_right)) == (4, 1, 0)


def test_the_chain_rule_and_by_definition_differ_by_the_embedding():
    arm = dyn.planar_arm([1.0] * 3, [1.0] * 3)
    verdicts = [dyn.formulation_verdict(arm, name) for name in ("chain_rule", "by_definition")]
    chain, embedded = (each.graph for each in verdicts)
    atoms = "q0 q1 q2 qd0 qd1 qd2"
    found = compare(chain, embedded, atoms=atoms, classify=formulation_classes(verdicts))
    assert found.classes("right")["spurious"] == len(dyn.spurious_nodes(embedded))
    assert set(found.classes("left")) == {"needed"}
    assert len(found.common) > 2 * len(compare(chain, embedded).common)  # without atoms, q is never the same
    both = found.overlay()
    assert {"right q0", "right qd2", "left tau0", "right tau0"} <= set(both.graph.outputs)
    text = json.dumps(found.to_dict(), allow_nan=False)
    assert '"class": "spurious"' in text


def test_a_variable_that_neither_graph_uses_is_an_atom_all_the_same() -> None:
    left, right = cg.Graph([x, y], {"f": cg.sin(y)}), cg.Graph([x, y], {"f": cg.cos(y)})
    found = cg.compare(left, right, atoms="x y")
    assert list(found.atoms.values()) == ["y"]
    assert found.other_outputs == ("f",)
    with pytest.raises(cg.GraphError, match="neither graph has a node called z"):
        cg.compare(left, right, atoms="x z")
