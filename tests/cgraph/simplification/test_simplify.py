"""simplify and specialize: fewer nodes, the same function."""

import math

import pytest
from hypothesis import assume, given, settings, strategies as st
from mpmath import mpf

import cgraph as cg
from cgraph import GraphError
from cgraph.core.node import apply
from cgraph.extend import OPS
from tests import high_precision
from tests.each_row import each_row
from tests.strategies import cases, examples
from tests.tolerances import LAST_BITS

x, y, z = cg.variables("x y z")
ROUNDINGS = 4 * 2.0**-53  # relative error of one operation: 4 half ulps
KINK_DISTANCE = 1e-6


def size(graph: cg.Graph) -> tuple[int, int]:
    """Nodes, then edges."""
    counts = graph.counts()
    return counts.nodes, counts.edges


def assert_same_function(graph: cg.Graph, other: cg.Graph, values: dict[str, float]) -> None:
    """The other graph, in floats and in 50 digits, is the graph in 50 digits within the rounding of its operations.

    `rounding_size` is the sum over all nodes of |d output / d node| |node|.
    """
    other_values = {name: value for name, value in values.items() if name in other.input_names}
    exact = high_precision.evaluate(graph, values)
    before = high_precision.rounding_size(graph, values)
    after = high_precision.rounding_size(other, other_values)
    precise = high_precision.evaluate(other, other_values)
    for name, found in other.evaluate(other_values).items():
        assert abs(precise[name] - exact[name]) <= ROUNDINGS * before[name]  # constants were folded in floats
        assert abs(mpf(found) - exact[name]) <= ROUNDINGS * (before[name] + after[name])


@settings(max_examples=examples(400))
@given(cases(max_operations=30), st.data())
def test_simplify_and_specialize_never_grow_and_keep_the_function(case, data):
    graph = case.graph
    bound = data.draw(st.lists(st.sampled_from(graph.input_names), unique=True))
    kept = data.draw(st.lists(st.sampled_from(list(graph.outputs)), unique=True, min_size=1))
    simple, special = cg.simplify(graph), cg.specialize(graph, {name: case.values[name] for name in bound}, kept)
    assert simple.input_names == graph.input_names
    assert list(simple.outputs) == list(graph.outputs)
    assert special.input_names == tuple([name for name in graph.input_names if name not in bound])
    assert list(special.outputs) == kept
    for result in (simple, special):
        result.check()
        assert size(result) <= size(graph)
    assume(high_precision.kink_distance(graph, case.values) > KINK_DISTANCE)
    for result in (simple, special):
        assert_same_function(graph, result, case.values)


@settings(max_examples=examples(150))
@given(cases())
def test_simplify_is_done_when_it_is_done(case):
    simple = cg.simplify(case.graph)
    assert cg.simplify(simple).listing() == simple.listing()


def simple(node: cg.Node) -> str:
    """The listing after simplification, without inputs, roles and the word output."""
    lines = cg.simplify(cg.Graph([x, y, z], {"f": node})).listing().splitlines()[1:]
    return "; ".join(line.split("  #")[0].removeprefix("output ") for line in lines)


IS_X = (
        x + 0, 0 + x, x + -0.0, x - 0, 1 * x, x * 1, x / 1, x**1, 0 - (0 - x), -1 * -x, (-x) / -1, x * 2 * 0.5,
        3 + (x - 3), cg.where(1.0, x, y), cg.where(0.0, y, x), cg.where(y > 0, x, x), cg.minimum(x, x),
        cg.maximum(x, x), x + (y - y), x * (y / y), x + 0 * y, x + y * 0, x + 0 / y, x * y**0, 1 / x**-1 * 0 + x,
)  # fmt: skip


NEGATIVE = -x
IS_ZERO = (0 * x, x * 0, x - x, 0 / x, 0 * x * y, (x + y) - (y + x), cg.sin(0 * x))


def test_what_is_x_becomes_x_and_what_is_zero_zero():
    assert [simple(node) for node in (*IS_X, -NEGATIVE)] == ["f = x"] * (len(IS_X) + 1)
    assert {simple(node) for node in IS_ZERO} <= {"f = 0.0", "f = -0.0"}


FOLDS = (
    (x**2, "%1 = mul x x; f = %1"),
    (x**0.5, "%1 = sqrt x; f = %1"),
    (x**0, "f = 1.0"),
    (1 / cg.constant(0.0), "f = inf"),
    (cg.exp(cg.constant(-1000.0)), "f = 0.0"),
    (x / x, "f = 1.0"),
    (2 * (3 * x), "%1 = mul 6.0 x; f = %1"),
    ((x * 3) * 2, "%1 = mul 6.0 x; f = %1"),
    (2 * (0.5 * x * y), "%1 = mul x y; f = %1"),
    (y * (0.5 * x) * -2, "%1 = mul x y; %2 = neg %1; f = %2"),
    (4 * (0.5 * x * y), "%1 = mul 0.5 x; %2 = mul %1 y; %3 = mul 4.0 %2; f = %3"),
    (2 * -(3 * x), "%1 = mul -6.0 x; f = %1"),
    (2 + (3 + x), "%1 = add 5.0 x; f = %1"),
    (5 - (2 - x), "%1 = add 3.0 x; f = %1"),
    (5 - (2 + x), "%1 = sub 3.0 x; f = %1"),
    (cg.sin(-x) + cg.sin(x), "f = 0.0"),
    (cg.sin(-x) * cg.sin(-y), "%1 = sin x; %2 = sin y; %3 = mul %1 %2; f = %3"),
    (cg.cos(-x), "%1 = cos x; f = %1"),
    (abs(-x), "%1 = abs x; f = %1"),
    (abs(x) ** 2, "%1 = mul x x; f = %1"),
    (x + -y, "%1 = sub x y; f = %1"),
    (x - -y, "%1 = add x y; f = %1"),
    (-x * -y, "%1 = mul x y; f = %1"),
    (-x / -y, "%1 = div x y; f = %1"),
    (-(x - y), "%1 = sub y x; f = %1"),
    (cg.sin(cg.constant(0.0)) + cg.exp(cg.constant(0.0)) * 2, "f = 2.0"),
    ((x * y) / (y * x), "f = 1.0"),
    (cg.sin(x * y) * cg.sin(y * x), "%1 = mul x y; %2 = sin %1; %3 = mul %2 %2; f = %3"),
    (cg.minimum(x, y) - cg.minimum(y, x), "f = 0.0"),
    (x - y + (x - y) * z - (y - x) * 0, "%1 = sub x y; %2 = mul %1 z; %3 = add %1 %2; f = %3"),
)


def test_folds():
    assert [simple(node) for node, _ in FOLDS] == [expected for _, expected in FOLDS]


def test_what_commutes_is_merged_and_nothing_else():
    for op in OPS.values():
        if op.arity == 2:
            result = cg.simplify(cg.Graph([x, y], {"f": apply(op, x, y), "g": apply(op, y, x)}))
            assert (result.outputs["f"] is result.outputs["g"]) is op.commutative, op.name
            assert op.commutative or size(result) == (4, 4), op.name


@each_row("node", [cg.log(cg.constant(-1.0)), cg.constant(math.inf) - math.inf, 0 * cg.constant(math.inf)])
def test_a_constant_expression_without_a_number_stays(node):
    result = cg.simplify(cg.Graph([], {"f": node}))
    assert math.isnan(result.evaluate({})["f"])


def test_specialize_takes_several_inputs_numbers_of_any_kind_and_chosen_outputs():
    graph = cg.Graph([x, y, z], {"f": x * y + z, "g": cg.sin(z)})
    special = cg.specialize(graph, {"x": 2, "y": cg.constant(3.0)}, outputs=["f"])
    assert special.listing().replace("  # primal", "") == "inputs z\n%1 = add 6.0 z\noutput f = %1\n"
    assert list(cg.specialize(graph, {}, outputs=["g", "f"]).outputs) == ["g", "f"]


@each_row(
    ("bound", "outputs", "error", "words"),
    [
        ({"w": 1.0}, None, GraphError, r"no input '?w"),
        ({"x": 1.0}, ["g"], GraphError, r"no output '?g"),
        ({"x": 1.0}, [], GraphError, "at least one output"),
        ({"x": math.nan}, None, ValueError, r"input 'x'.*NaN"),
        ({"x": 1j}, None, TypeError, r"input 'x'.*real number"),
    ],
)
def test_specialize_names_what_is_wrong(bound, outputs, error, words):
    with pytest.raises(error, match=words):
        cg.specialize(cg.Graph([x, y], {"f": x * y}), bound, outputs)


def test_specialize_substitutes_nodes_over_the_other_inputs_all_at_once():
    graph = cg.Graph([x, y, z], {"f": x - 2 * y + z})
    special = cg.specialize(graph, {"x": cg.sin(z), "y": z * z})
    assert special.input_names == ("z",)
    assert special.evaluate({"z": 3.0}) == {"f": pytest.approx(math.sin(3.0) - 18.0 + 3.0, rel=LAST_BITS)}
    with pytest.raises(GraphError, match="'y'"):  # the y in the new x is not an input of the result
        cg.specialize(graph, {"x": y + z, "y": 5.0})
