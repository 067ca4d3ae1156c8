"""The structure hash: what it tells apart, what it does not, and that it is the same in every process."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
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


@pytest.mark.parametrize(
    "other",
    [
        graph(cg.sin(x) * 2.0 + z),  # another variable
        graph(cg.cos(x) * 2.0 + y),  # another operation
        graph(cg.sin(x) * 2.0000000000000004 + y),  # the last bit of a constant
        graph(cg.sin(x) * 2.0 + y, name="g"),
        graph(cg.sin(x) * 2.0 + y, [y, x, z]),
        graph(cg.sin(x) * 2.0 + y, [x, y]),
        cg.Graph([x, y, z], {"f": cg.sin(x) * 2.0 + y, "g": x}),
        graph(cg.sin(x * 2.0) + y),
    ],
)
def test_another_function_has_another_hash(other):
    assert structure_hash(other) != structure_hash(graph(cg.sin(x) * 2.0 + y))


def test_zero_and_minus_zero_differ():
    assert structure_hash(graph(x + 0.0)) != structure_hash(graph(x + -0.0))


def test_outputs_in_another_order_are_another_graph():
    one, other = (
        cg.Graph([x, y], {name: nodes[name] for name in order})
        for nodes in [{"f": x, "g": y}]
        for order in ("fg", "gf")
    )
    assert structure_hash(one) != structure_hash(other)


def test_names_that_run_together_stay_apart():
    a, bc, ab, c = cg.variables("a bc ab c")
    assert structure_hash(cg.Graph([a, bc], {"f": a})) != structure_hash(cg.Graph([ab, c], {"f": ab}))


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


def test_every_process_gives_the_same_hash():
    """Python's own hash of a string differs between processes; this must not."""
    program = (
        "import cgraph as cg; from cgraph.writing.structure_hash import structure_hash; x, y = cg.variables('x y');"
        "print(structure_hash(cg.Graph([x, y], {'f': cg.atan2(y, 0.1 * x) + cg.hypot(x, y)})))"
    )
    root = str(Path(cg.__file__).parents[1])
    runs = [
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": root},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert runs == ["10584127ca660b881fa3ec830c2e630f\n"] * 2


def test_a_deep_graph_needs_no_recursion():
    node = x
    for _ in range(20_000):
        node = cg.sin(node)
    assert len(structure_hash(graph(node))) == 32
