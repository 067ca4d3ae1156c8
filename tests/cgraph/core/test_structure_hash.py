"""The structure hash: what it tells apart, what it does not, and that it is the same in every process."""

from hypothesis import given

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from cgraph.writing.structure_hash import node_hashes, structure_hash
from tests.strategies import Case, cases

x, y, z = cg.variables("x y z")


def graph(value: cg.Node, inputs: list[cg.Node] | None = None, name: str = "f") -> cg.Graph:
    return cg.Graph(inputs or [x, y, z], {name: value})


def test_what_commutes_may_be_turned_and_nothing_else():
    for op in OPS.values():
        if op.arity == 2:
            one, other = (graph(apply(op, *args)) for args in ((x, y), (y, x)))
            assert (structure_hash(one) == structure_hash(other)) is op.commutative, op.name


a, ab, bc, c = cg.variables("a ab bc c")
BASE = graph(cg.sin(x) * 2.0 + y)
OTHERS = {
    "another variable": (BASE, graph(cg.sin(x) * 2.0 + z)),
    "another operation": (BASE, graph(cg.cos(x) * 2.0 + y)),
    "the last bit of a constant": (BASE, graph(cg.sin(x) * 2.0000000000000004 + y)),
    "the sign of a zero": (graph(x + 0.0), graph(x + -0.0)),
    "another name of an output": (BASE, graph(cg.sin(x) * 2.0 + y, name="g")),
    "another order of inputs": (BASE, graph(cg.sin(x) * 2.0 + y, [y, x, z])),
    "an input that nothing uses": (BASE, graph(cg.sin(x) * 2.0 + y, [x, y])),
    "another output": (BASE, cg.Graph([x, y, z], {"f": cg.sin(x) * 2.0 + y, "g": x})),
    "another order of outputs": (cg.Graph([x, y], {"f": x, "g": y}), cg.Graph([x, y], {"g": y, "f": x})),
    "another order of operations": (BASE, graph(cg.sin(x * 2.0) + y)),
    "names that run together": (cg.Graph([a, bc], {"f": a}), cg.Graph([ab, c], {"f": ab})),
}


def test_another_function_has_another_hash():
    assert [what for what, (one, other) in OTHERS.items() if structure_hash(one) == structure_hash(other)] == []


def test_tags_names_and_copies_do_not_count():
    plain = graph(cg.sin(x) * cg.sin(x))
    with cg.tag("link 1"):
        same = cg.with_name(cg.sin(x), "s")
        tagged = graph(same * same)
    assert structure_hash(plain) == structure_hash(tagged)


def test_an_atom_stands_for_a_variable():
    inner = x * y
    one, other = graph(cg.sin(inner)), graph(cg.sin(z))
    assert node_hashes(one.nodes, {inner: "z"})[one.outputs["f"]] == node_hashes(other.nodes)[other.outputs["f"]]


@given(cases())
def test_a_copy_has_the_same_hash(case: Case):
    assert structure_hash(cg.Graph(case.graph.inputs, case.graph(*case.graph.inputs))) == structure_hash(case.graph)
