"""A graph, its nodes and its values say what is wrong with them."""

import math
import re
import time
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import cgraph as cg
from cgraph import GraphError
from cgraph.core.node import CONSTANT, VARIABLE, Node
from cgraph.operations.operation import OPS

x, y, z = cg.variables("x y z")


def forge(node: Node, **fields: object) -> Node:
    """What no public function allows."""
    for name, value in fields.items():
        object.__setattr__(node, name, value)
    return node


def test_graph_error_is_a_value_error():
    assert issubclass(GraphError, ValueError)


def test_a_free_variable_is_named():
    with pytest.raises(GraphError, match=r"'y', 'z'.*\(x\)"):
        cg.Graph([x], {"f": x * z + y})


def test_a_repeated_input_is_named():
    with pytest.raises(GraphError, match="'x' is listed more than once"):
        cg.Graph([x, y, x], {"f": x})


@pytest.mark.parametrize("wrong", [2.0, "x", x + y, cg.constant(1.0), None])
def test_an_input_that_is_not_a_variable_is_an_error(wrong):
    with pytest.raises(TypeError, match="must be a variable"):
        cg.Graph([x, wrong], {"f": x})


def test_a_single_node_for_inputs_is_an_error():
    with pytest.raises(TypeError, match=r"write \[x\]"):
        cg.Graph(x, {"f": x})


@pytest.mark.parametrize("wrong", [x, [x], [("f", x)], None, "f"])
def test_outputs_that_do_not_map_names_to_nodes_are_an_error(wrong):
    with pytest.raises(TypeError, match="outputs must map names to nodes"):
        cg.Graph([x], wrong)


@pytest.mark.parametrize("wrong", ["x", None, 1j, [x], np.array([1.0, 2.0])])
def test_an_output_that_is_not_a_node_is_named(wrong):
    with pytest.raises(TypeError, match="output 'f'"):
        cg.Graph([x], {"f": wrong})


@pytest.mark.parametrize("wrong", ["", 1, None, x])
def test_an_output_needs_a_name(wrong):
    with pytest.raises((TypeError, ValueError), match="the name of an output must"):
        cg.Graph([x], {wrong: x})


def test_a_graph_needs_an_output():
    with pytest.raises(GraphError, match="at least one output"):
        cg.Graph([x], {})


def test_an_output_may_be_a_number_or_an_input_or_shared():
    graph = cg.Graph([x], {"one": 1, "same": x, "again": x})
    assert graph.evaluate({"x": 3.0}) == {"one": 1.0, "same": 3.0, "again": 3.0}


GRAPH = cg.Graph([x, y], {"f": x + y})


def test_a_missing_value_is_named():
    with pytest.raises(GraphError, match=r"no value for input '?y"):
        GRAPH.evaluate({"x": 1.0})


def test_an_unknown_value_is_named():
    with pytest.raises(GraphError, match=r"no input '?w'? \(it has x, y\)"):
        GRAPH.evaluate({"x": 1.0, "y": 1.0, "w": 1.0})


def test_shapes_that_do_not_broadcast_are_listed():
    with pytest.raises(GraphError, match=r"x \(2,\), y \(3,\)"):
        GRAPH.evaluate({"x": np.ones(2), "y": np.ones(3)})


@pytest.mark.parametrize("wrong", [1j, np.ones(2) * 1j, "1.0", None, np.array(["a"]), [None], x, object()])
def test_a_value_that_is_not_real_is_an_error(wrong):
    with pytest.raises(TypeError, match="input 'x' must be real numbers, got"):
        GRAPH.evaluate({"x": wrong, "y": 1.0})


@pytest.mark.parametrize("value", [2, np.int8(2), np.float32(2), np.array(2.0), np.uint64(2)])
def test_any_real_number_is_a_value_and_gives_a_float(value):
    result = GRAPH.evaluate({"x": value, "y": 1})["f"]
    assert result == 3.0
    assert type(result) is float


def test_arrays_broadcast_to_one_shape_and_to_float64():
    graph = cg.Graph([x, y], {"f": x + y, "x": x, "c": 2.0})
    result = graph.evaluate({"x": np.arange(3), "y": [[1], [2]]})
    assert {name: (value.shape, value.dtype) for name, value in result.items()} == dict.fromkeys(
        ("f", "x", "c"), ((2, 3), np.dtype(np.float64))
    )
    assert result["f"].tolist() == [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]
    assert result["c"].tolist() == [[2.0] * 3] * 2


def test_an_output_does_not_share_memory_with_an_input():
    given = np.array([1.0, 2.0])
    result = cg.Graph([x], {"same": x, "again": x}).evaluate({"x": given})
    result["same"][0] = 7.0
    assert given.tolist() == [1.0, 2.0]


def test_out_of_domain_gives_nan_and_raises_nothing():
    graph = cg.Graph([x], {"f": cg.log(x), "g": 1 / x, "h": cg.exp(x)})
    with np.errstate(all="raise"):
        results = graph.evaluate({"x": -1.0}), graph.evaluate({"x": np.array([-1.0, 0.0])})
    assert math.isnan(results[0]["f"])
    assert results[1]["g"].tolist() == [-1.0, math.inf]


@pytest.mark.parametrize("nan", [math.nan, np.nan, np.float32("nan"), np.array(math.nan)])
def test_nan_is_not_a_constant(nan):
    with pytest.raises(ValueError, match="NaN"):
        cg.constant(nan)
    with pytest.raises(ValueError, match="NaN"):
        x * nan


@pytest.mark.parametrize("wrong", [1j, "1", None, [1.0], np.complex128(1)])
def test_a_constant_must_be_real(wrong):
    with pytest.raises(TypeError, match="real number"):
        cg.constant(wrong)


@pytest.mark.parametrize(
    ("wrong", "error"), [("", ValueError), ("a b", ValueError), (" a", ValueError), (1, TypeError)]
)
def test_a_variable_needs_a_name_without_white_space(wrong, error):
    with pytest.raises(error, match="name"):
        cg.variable(wrong)


def test_equal_leaves_are_one_node():
    assert cg.variable("x") is x
    assert cg.variables("x, y") == [x, y]
    assert cg.constant(2) is cg.constant(2.0)
    assert cg.constant(0.0) is not cg.constant(-0.0)


def test_a_node_has_no_truth_value_and_no_number():
    with pytest.raises(TypeError, match=r"cg\.where"):
        bool(x < y)
    with pytest.raises(TypeError, match="evaluate"):
        float(x)
    assert float(cg.constant(2.5)) == 2.5


def test_nodes_compare_by_identity():
    first, second = x + y, x + y
    assert first != second
    assert len({first, second, first}) == 2


@pytest.mark.parametrize("name", ["op", "args", "value", "name", "label", "new"])
@pytest.mark.parametrize("change", [lambda node, name: setattr(node, name, None), delattr], ids=["set", "delete"])
def test_a_node_cannot_be_changed(name, change):
    node = x + y
    with pytest.raises(AttributeError, match="immutable"):
        change(node, name)
    assert (node.op, node.args) == (OPS["add"], (x, y))


def test_a_row_of_the_table_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        OPS["add"].arity = 3


def test_a_wrong_number_of_arguments_is_an_error():
    with pytest.raises(TypeError, match=r"atan2 takes 2 argument\(s\), got 1"):
        cg.atan2(x)


def test_transforms_of_one_output_refuse_several():
    graph = cg.Graph([x], {"f": x, "g": x})
    for transform in (cg.gradient, cg.hessian):
        with pytest.raises(GraphError, match=re.escape("got 2: f, g")):
            transform(graph)


@pytest.mark.parametrize("transform", [cg.jvp, cg.vjp, cg.gradient, cg.jacobian, cg.hessian])
@pytest.mark.parametrize("wrong", ["w", ["x", "w"], z, [x, z]])
def test_wrt_must_be_inputs(transform, wrong):
    with pytest.raises(GraphError, match=r"no input '?[wz]'? \(it has x, y\)"):
        transform(GRAPH, wrong)


def test_a_forged_cycle_is_found_by_the_constructor_and_by_check():
    inner = cg.sin(x)
    graph = cg.Graph([x], {"f": cg.exp(cg.cos(inner))})
    graph.check()
    forge(inner, args=graph.outputs["f"].args)  # sin(cos(sin(cos(...
    with pytest.raises(GraphError, match="cycle"):
        graph.check()
    with pytest.raises(GraphError, match="cycle"):
        cg.Graph([x], {"f": inner})


def test_a_node_that_is_its_own_argument_is_a_cycle():
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


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"args": (x,)}, r"mul takes 2 argument\(s\), a node has 1"),
        ({"args": (x, y, y)}, r"mul takes 2 argument\(s\), a node has 3"),
        ({"args": ()}, r"mul takes 2 argument\(s\), a node has 0"),
        ({"op": replace(OPS["mul"], name="times")}, "'times' is not in the table"),
        ({"op": replace(OPS["mul"])}, "'mul' is not in the table"),  # a copy is not the row
        ({"op": "mul"}, "not a node of an operation"),
        ({"args": (x, 2.0)}, "is not a node"),
        ({"op": CONSTANT, "args": (), "value": math.nan}, "not a number"),
        ({"op": CONSTANT, "args": (), "value": 1}, "not a number"),
        ({"op": VARIABLE, "args": (), "name": None}, "no name"),
    ],
)
def test_check_finds_a_forged_node(fields, message):
    with pytest.raises(GraphError, match=message):
        forged_graph(**fields).check()


def test_check_finds_nodes_that_are_not_those_of_the_outputs():
    with pytest.raises(GraphError):
        forged_graph(args=(cg.cos(x), y)).check()


def test_check_finds_a_wrong_order():
    graph = cg.Graph([x], {"f": cg.exp(cg.sin(x))})
    forge(graph, nodes=graph.nodes[::-1])
    with pytest.raises(GraphError, match="before one of its arguments"):
        graph.check()


def test_values_are_checked_in_a_time_that_grows_as_their_number() -> None:
    """Eight times as many inputs take eight times as long, not sixty-four times."""
    times = []
    for count in (500, 4000):
        inputs = cg.variables([f"x{k}" for k in range(count)])
        graph, values = cg.Graph(inputs, {"y": inputs[0]}), {f"x{k}": 1.0 for k in range(count)}
        taken = []
        for _ in range(3):
            begin = time.process_time()
            graph.evaluate(values)
            taken.append(time.process_time() - begin)
        times.append(min(taken))
    assert times[1] < 24.0 * times[0]
