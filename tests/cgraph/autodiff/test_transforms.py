"""Transforms: the names they give, the inputs they take, and a graph used as a function."""

import math
from functools import reduce
from itertools import pairwise

import pytest
from hypothesis import given, strategies as st

import cgraph as cg
from cgraph import GraphError
from tests.each_row import each_row

x, y, z = cg.variables("x y z")
GRAPH = cg.Graph([x, y], {"f": cg.sin(x) * y, "g": y * y})
ONE = cg.Graph([x, y], {"f": cg.sin(x) * y})


NAMES = {  # of a transform's inputs and outputs
    "jvp": (cg.jvp(GRAPH), "x y x_dot y_dot", "f_dot g_dot"),
    "vjp": (cg.vjp(GRAPH), "x y f_bar g_bar", "x_bar y_bar"),
    "gradient": (cg.gradient(ONE), "x y", "df/dx df/dy"),
    "hvp": (cg.hvp(ONE), "x y x_dot y_dot", "df/dx_dot df/dy_dot"),
    "jacobian": (cg.jacobian(GRAPH), "x y", "df/dx df/dy dg/dx dg/dy"),
    "jacobian in another order": (cg.jacobian(ONE, ["y", x]), "x y", "df/dy df/dx"),
    "hessian": (cg.hessian(ONE), "x y", "d2f/dxdx d2f/dxdy d2f/dydx d2f/dydy"),
}


def test_names_of_inputs_and_outputs():
    found = {name: (each, " ".join(each.input_names), " ".join(each.outputs)) for name, (each, *_) in NAMES.items()}
    assert found == NAMES
    values = {"x": 0.3, "y": 2.0}
    assert cg.jacobian(ONE, ["y", x]).evaluate(values) == cg.jacobian(ONE).evaluate(values)
    hessian = NAMES["hessian"][0]
    assert hessian.outputs["d2f/dxdy"] is hessian.outputs["d2f/dydx"]


def test_a_transform_of_a_transform_has_distinct_names():
    twice = cg.jvp(cg.jvp(ONE))
    assert twice.input_names == ("x", "y", "x_dot", "y_dot", "x_dot2", "y_dot2", "x_dot_dot2", "y_dot_dot2")
    assert list(twice.outputs) == ["f_dot_dot2"]
    thrice = cg.jvp(cg.jvp(cg.jvp(ONE, "x"), "x"), "x")
    assert thrice.input_names == ("x", "y", "x_dot", "x_dot2", "x_dot3")
    pulled = cg.vjp(cg.vjp(ONE))
    assert pulled.input_names == ("x", "y", "f_bar", "x_bar_bar", "y_bar_bar")
    assert list(pulled.outputs) == ["x_bar", "y_bar", "f_bar_bar"]
    for graph in (twice, thrice, pulled, cg.vjp(cg.vjp(cg.vjp(ONE)))):
        assert len(set(graph.input_names)) == len(graph.input_names)
        graph.check()


def test_a_tangents_name_that_is_taken_is_numbered():
    taken = cg.variable("x_dot")
    pushed = cg.jvp(cg.Graph([x, taken], {"f": x * taken}), "x")
    assert pushed.input_names == ("x", "x_dot", "x_dot2")
    assert pushed.evaluate({"x": 2.0, "x_dot": 3.0, "x_dot2": 5.0}) == {"f_dot2": 15.0}
    bar = cg.variable("f_bar")
    pulled = cg.vjp(cg.Graph([x, bar], {"f": x * bar}))
    assert pulled.input_names == ("x", "f_bar", "f_bar2")
    assert pulled.evaluate({"x": 2.0, "f_bar": 3.0, "f_bar2": 5.0}) == {"x_bar2": 15.0, "f_bar_bar2": 10.0}


NAMED = st.text("dx/2_", min_size=1, max_size=5)


@given(st.lists(NAMED, min_size=1, max_size=4, unique=True), st.lists(NAMED, min_size=1, max_size=3, unique=True))
def test_no_entry_is_lost_whatever_the_names(inputs, outputs):
    nodes = cg.variables(inputs)
    product = math.prod(nodes[1:], start=nodes[0])
    graph = cg.Graph(nodes, {name: product * product + float(i) * nodes[0] for i, name in enumerate(outputs)})
    first = cg.Graph(nodes, {outputs[0]: product * product})
    n, m = len(inputs), len(outputs)
    jacobian, hessian = cg.jacobian(graph), cg.hessian(first)
    assert len(jacobian.outputs) == m * n
    assert len(hessian.outputs) == n * n
    assert len(cg.gradient(first).outputs) == n
    assert len(cg.vjp(graph).outputs) == n
    assert len(cg.jvp(graph).outputs) == m
    point = {name: float(k + 2) for k, name in enumerate(inputs)}
    whole = math.prod(point.values())
    expected = [2 * whole**2 / point[v] + i * (v == inputs[0]) for i in range(m) for v in inputs]
    assert list(jacobian.evaluate(point).values()) == expected
    expected = [whole**2 / (point[v] * point[w]) * (2 if v == w else 4) for v in inputs for w in inputs]
    assert list(hessian.evaluate(point).values()) == expected


def test_entries_whose_joined_names_are_alike_are_named_by_place():
    u, v = cg.variables("x xdx")
    hessian = cg.hessian(cg.Graph([u, v], {"f": u * v}))
    assert hessian.evaluate({"x": 2.0, "xdx": 3.0}) == {
        "d2f/d0d0": 0.0,
        "d2f/d0d1": 1.0,
        "d2f/d1d0": 1.0,
        "d2f/d1d1": 0.0,
    }
    a, b = cg.variables("v u/dv")
    jacobian = cg.jacobian(cg.Graph([a, b], {"f/du": a, "f": b}))
    assert list(jacobian.outputs) == ["d0/d0", "d0/d1", "d1/d0", "d1/d1"]


@each_row("transform", [cg.jvp, cg.vjp, cg.hvp, cg.gradient, cg.jacobian, cg.hessian])
def test_an_input_named_twice_is_refused(transform):
    with pytest.raises(GraphError, match="wrt names the input x twice"):
        transform(ONE, ["x", y, x])


@each_row("wrt", ["y", y, ["y"], (y,)])
def test_wrt_is_a_name_a_variable_or_a_sequence_of_them(wrt):
    assert cg.jvp(GRAPH, wrt).input_names == ("x", "y", "y_dot")
    assert list(cg.vjp(GRAPH, wrt).outputs) == ["y_bar"]
    assert list(cg.gradient(ONE, wrt).outputs) == ["df/dy"]
    assert list(cg.jacobian(GRAPH, wrt).outputs) == ["df/dy", "dg/dy"]
    assert list(cg.hessian(ONE, wrt).outputs) == ["d2f/dydy"]
    assert list(cg.hvp(ONE, wrt).outputs) == ["df/dy_dot"]


def test_a_wide_jacobian_goes_in_reverse_and_a_tall_one_forward():
    w = cg.sin(x) * y + cg.exp(y) * z
    wide = cg.jacobian(cg.Graph([x, y, z], {"w": w}))
    tall = cg.jacobian(cg.Graph([x, y, z], {"w": w, "a": x, "b": y, "c": z}))
    assert wide.counts().by_role.keys() & {"adjoint", "tangent"} == {"adjoint"}
    assert tall.counts().by_role.keys() & {"adjoint", "tangent"} == {"tangent"}


def test_a_transform_leaves_its_graph_alone():
    before = GRAPH.listing()
    for transform in (cg.jvp, cg.vjp, cg.jacobian, cg.simplify):
        transform(GRAPH)
    assert GRAPH.listing() == before


def bodies(n):
    q = cg.variables([f"{axis}{i}" for i in range(n) for axis in "xyz"])
    pairs = [[q[3 * i + k] - q[3 * j + k] for k in range(3)] for i in range(n) for j in range(i)]
    return cg.Graph(q, {"V": sum([1.0 / cg.sqrt(x * x + y * y + z * z) for x, y, z in pairs], cg.constant(0.0))})


def product(n):
    q = cg.variables([f"q{i}" for i in range(n)])
    return cg.Graph(q, {"f": reduce(lambda y, x: cg.sin(y * x), q)})


def rosenbrock(n):
    q = cg.variables([f"q{i}" for i in range(n)])
    return cg.Graph(q, {"f": sum([100.0 * (b - a * a) ** 2 + (1.0 - a) ** 2 for a, b in pairwise(q)], 0.0 * q[0])})


@each_row("graph,cap", [(bodies(5), (238, 518, 953)), (rosenbrock(20), (189, 285, 190)), (product(8), (40, 127, 329))])
def test_derivatives_take_no_more_operations_than_are_known(graph, cap):
    """Of gradient, Hessian-vector product and Hessian, most of them CasADi 3.8.2's after its `cse`."""
    for derive, k in zip((cg.gradient, cg.hvp, cg.hessian), cap, strict=True):
        assert sum(bool(node.args) for node in cg.simplify(derive(graph)).nodes) <= k


def test_a_gradient_and_a_hessian_vector_product_cost_fixed_multiples_of_their_graph():
    """The cheap gradient principle, counted: whatever the number of inputs, the nodes stay in proportion."""
    for derive, most in ((cg.gradient, 4), (cg.hvp, 13)):
        ratios = [derive(product(n)).counts().nodes / product(n).counts().nodes for n in (10, 100, 1000)]
        assert max(ratios) < most
        assert ratios[2] == pytest.approx(ratios[1], rel=0.02)


def test_a_graph_is_a_function_of_nodes():
    by_position = cg.Graph([z], GRAPH(z, 2.0))
    by_name = cg.Graph([z], GRAPH(y=2.0, x=z))
    mixed = cg.Graph([z], GRAPH(z, y=2))
    expected = {"f": math.sin(0.3) * 2.0, "g": 4.0}
    for graph in (by_position, by_name, mixed):
        assert graph.evaluate({"z": 0.3}) == expected
    swapped = cg.Graph([x, y], GRAPH(y, x))
    assert swapped.evaluate({"x": 2.0, "y": 0.3}) == expected


def test_a_graph_used_inside_another_is_inlined_as_written():
    inner = cg.Graph([x], {"f": (x + 0) * x})
    outer = cg.Graph([x], {"h": inner(inner(x)["f"])["f"]})
    assert outer.counts().by_operation == {"add": 2, "mul": 2, "constant": 1, "variable": 1}
    assert outer.evaluate({"x": 3.0}) == {"h": 81.0}


@each_row(
    ("args", "named", "error", "message"),
    [
        ((x,), {}, TypeError, "no value for input '?y"),
        ((), {}, TypeError, "no value for input '?x'?, '?y"),
        ((x, y, z), {}, TypeError, "has 2 inputs, got 3"),
        ((x, y), {"x": z}, TypeError, "'x' is given twice"),
        ((x,), {"w": z}, GraphError, "no input '?w"),
        ((x, "y"), {}, TypeError, "real number"),
        ((x, math.nan), {}, ValueError, "NaN"),
    ],
)
def test_calling_a_graph_wrongly_says_what_is_wrong(args, named, error, message):
    with pytest.raises(error, match=message):
        GRAPH(*args, **named)
