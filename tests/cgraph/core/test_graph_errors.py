"""A graph, its nodes and its values say what is wrong with them."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import cgraph as cg
from cgraph import GraphError
from cgraph.core.node import CONSTANT, VARIABLE, Leaf, Node
from cgraph.operations.operation import OPS
from tests.each_row import each_row

x, y, z = cg.variables("x y z")


def forge(node: Node, **fields: object) -> Node:
    """What no public function allows."""
    for name, value in fields.items():
        object.__setattr__(node, name, value)
    return node


GRAPH = cg.Graph([x, y], {"f": x + y})
assert issubclass(GraphError, ValueError)


# {what is refused: (call of one wrong thing, the wrong things, the error, what it says)}
REFUSED = {
    "a free variable": (lambda node: cg.Graph([x], {"f": node}), [x * z + y], GraphError, r"'y', 'z'.*\(x\)"),
    "a repeated input": (
        lambda inputs: cg.Graph(inputs, {"f": x}), [[x, y, x]], GraphError, "'x' is listed more than once"
    ),
    "an input that is no variable": (
        lambda wrong: cg.Graph([x, wrong], {"f": x}), [2.0, "x", x + y, cg.constant(1.0), None], TypeError,
        "must be a variable",
    ),
    "a single node for inputs": (lambda node: cg.Graph(node, {"f": node}), [x], TypeError, r"write \[x\]"),
    "outputs that map nothing": (
        lambda wrong: cg.Graph([x], wrong), [x, [x], [("f", x)], None, "f"], TypeError,
        "outputs must map names to nodes",
    ),
    "an output that is no node": (
        lambda wrong: cg.Graph([x], {"f": wrong}), ["x", None, 1j, [x], np.array([1.0, 2.0])], TypeError, "output 'f'"
    ),
    "an output without a name": (
        lambda wrong: cg.Graph([x], {wrong: x}), ["", 1, None, x], (TypeError, ValueError), "the name of an output must"
    ),
    "a graph without outputs": (lambda outputs: cg.Graph([x], outputs), [{}], GraphError, "at least one output"),
    "a missing value": (GRAPH.evaluate, [{"x": 1.0}], GraphError, r"no value for input '?y"),
    "an unknown value": (
        GRAPH.evaluate, [{"x": 1.0, "y": 1.0, "w": 1.0}], GraphError, r"no input '?w'? \(it has x, y\)"
    ),
    "shapes that do not broadcast": (
        GRAPH.evaluate, [{"x": np.ones(2), "y": np.ones(3)}], GraphError, r"x \(2,\), y \(3,\)"
    ),
    "a value that is not real": (
        lambda value: GRAPH.evaluate({"x": value, "y": 1.0}),
        [1j, np.ones(2) * 1j, "1.0", None, np.array(["a"]), [None], x, object()], TypeError,
        "input 'x' must be real numbers, got",
    ),
    "a constant that is NaN": (
        cg.constant, [math.nan, np.nan, np.float32("nan"), np.array(math.nan)], ValueError, "NaN"
    ),
    "a factor that is NaN": (
        lambda nan: x * nan, [math.nan, np.nan, np.float32("nan"), np.array(math.nan)], ValueError, "NaN"
    ),
    "a constant that is not real": (cg.constant, [1j, "1", None, [1.0], np.complex128(1)], TypeError, "real number"),
    "a variable with white space": (cg.variable, ["", "a b", " a"], ValueError, "name"),
    "a variable without a name": (cg.variable, [1], TypeError, "name"),
    "the truth of a node": (bool, [x < y], TypeError, r"cg\.where"),
    "the number of a node": (float, [x], TypeError, "evaluate"),
    "a change of a row": (lambda n: setattr(OPS["add"], "arity", n), [3], FrozenInstanceError, "arity"),
    "too few arguments": (cg.atan2, [x], TypeError, r"atan2 takes 2 argument\(s\), got 1"),
    "two outputs for one": (
        lambda transform: transform(cg.Graph([x], {"f": x, "g": x})), [cg.gradient, cg.hessian], GraphError,
        "got 2: f, g",
    ),
    **{
        f"{transform.__name__} by what is no input": (
            lambda wrong, transform=transform: transform(GRAPH, wrong), ["w", ["x", "w"], z, [x, z]], GraphError,
            r"no input '?[wz]'? \(it has x, y\)",
        )
        for transform in (cg.jvp, cg.vjp, cg.gradient, cg.jacobian, cg.hessian)
    },
}  # fmt: skip


@each_row("what", REFUSED)
def test_what_is_wrong_is_told(what):
    call, wrongs, error, words = REFUSED[what]
    for wrong in wrongs:
        with pytest.raises(error, match=words):
            call(wrong)


def test_an_output_may_be_a_number_or_an_input_or_shared():
    graph = cg.Graph([x], {"one": 1, "same": x, "again": x})
    assert graph.evaluate({"x": 3.0}) == {"one": 1.0, "same": 3.0, "again": 3.0}


def test_arrays_broadcast_to_one_shape_and_to_float64():
    graph = cg.Graph([x, y], {"f": x + y, "x": x, "c": 2.0})
    result = graph.evaluate({"x": np.arange(3), "y": [[1], [2]]})
    assert {name: (value.shape, value.dtype) for name, value in result.items()} == dict.fromkeys(
        ("f", "x", "c"), ((2, 3), np.dtype(np.float64))
    )
    assert result["f"].tolist() == [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]
    assert result["c"].tolist() == [[2.0] * 3] * 2


def test_out_of_domain_gives_nan_and_raises_nothing():
    graph = cg.Graph([x], {"f": cg.log(x), "g": 1 / x, "h": cg.exp(x)})
    with np.errstate(all="raise"):
        results = graph.evaluate({"x": -1.0}), graph.evaluate({"x": np.array([-1.0, 0.0])})
    assert math.isnan(results[0]["f"])
    assert results[1]["g"].tolist() == [-1.0, math.inf]


def test_equal_leaves_are_one_node_and_operations_are_not():
    assert cg.variable("x") is x
    assert cg.variables("x, y") == [x, y]
    assert cg.constant(2) is cg.constant(2.0)
    assert cg.constant(0.0) is not cg.constant(-0.0)
    assert float(cg.constant(2.5)) == 2.5
    first, second = x + y, x + y
    assert first != second
    assert len({first, second, first}) == 2


@each_row("name", ["op", "args", "value", "name", "label", "new"])
def test_a_node_cannot_be_changed(name):
    node = x + y
    with pytest.raises(AttributeError, match="immutable"):
        setattr(node, name, None)
    with pytest.raises(AttributeError, match="immutable"):
        delattr(node, name)
    assert (node.op, node.args) == (OPS["add"], (x, y))


def test_a_forged_cycle_is_found_by_the_constructor_and_by_check():
    inner = cg.sin(x)
    graph = cg.Graph([x], {"f": cg.exp(cg.cos(inner))})
    graph.check()
    forge(inner, args=graph.outputs["f"].args)  # sin(cos(sin(cos(...
    with pytest.raises(GraphError, match="cycle"):
        graph.check()
    with pytest.raises(GraphError, match="cycle"):
        cg.Graph([x], {"f": inner})
    node = x + y
    forge(node, args=(node, y))
    with pytest.raises(GraphError, match="cycle"):
        cg.Graph([x, y], {"f": node})


def forged_graph(**fields: object) -> cg.Graph:
    """The graph of sin(x) * y whose product is then changed."""
    node = cg.sin(x) * y
    graph = cg.Graph([x, y], {"f": node + 1})
    graph.check()
    forge(node, **fields)
    return graph


@each_row(
    ("fields", "message"),
    [
        ({"args": (x,)}, r"mul takes 2 argument\(s\), a node has 1"),
        ({"args": (x, y, y)}, r"mul takes 2 argument\(s\), a node has 3"),
        ({"args": ()}, r"mul takes 2 argument\(s\), a node has 0"),
        ({"op": replace(OPS["mul"], name="times")}, "'times' is not in the table"),
        ({"op": replace(OPS["mul"])}, "'mul' is not in the table"),  # a copy is not the row
        ({"op": "mul"}, "not a node of an operation"),
        ({"args": (x, 2.0)}, "is not a node"),
        ({"op": CONSTANT, "args": ()}, "not a number"),
        ({"op": VARIABLE, "args": (), "name": None}, "no name"),
    ],
)
def test_check_finds_a_forged_node(fields, message):
    with pytest.raises(GraphError, match=message):
        forged_graph(**fields).check()


@each_row("value", [math.nan, 1])
def test_check_finds_a_constant_that_is_no_number(value):
    with pytest.raises(GraphError, match="not a number"):
        cg.Graph([x], {"f": x + Leaf(CONSTANT, value=value)}).check()


def test_check_finds_other_nodes_than_those_of_the_outputs_and_a_wrong_order():
    with pytest.raises(GraphError):
        forged_graph(args=(cg.cos(x), y)).check()
    graph = cg.Graph([x], {"f": cg.exp(cg.sin(x))})
    forge(graph, nodes=graph.nodes[::-1])
    with pytest.raises(GraphError, match="before one of its arguments"):
        graph.check()
