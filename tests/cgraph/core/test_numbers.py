"""Numbers and arrays on either side of a node, and the operators of Python on nodes."""

import math
import operator
from fractions import Fraction

import numpy as np
import pytest

import cgraph as cg
from cgraph.core.node import Node
from tests.tolerances import LAST_BITS

x, y = cg.variables("x y")
X, Y = 0.7, 0.4  # their values


def value(node: Node) -> float:
    return cg.Graph([x, y], {"f": node}).evaluate({"x": X, "y": Y})["f"]


NUMBERS = [2, 2.5, True, Fraction(3, 2), np.float64(1.5), np.float32(1.5), np.int64(3), np.uint8(3), np.array(1.5)]
ARITHMETIC = [operator.add, operator.sub, operator.mul, operator.truediv, operator.pow]
COMPARISONS = [operator.lt, operator.le, operator.gt, operator.ge]


@pytest.mark.parametrize("operation", [*ARITHMETIC, *COMPARISONS])
def test_an_operator_takes_a_number_on_either_side(operation):
    for number in (*NUMBERS, X):
        for node, expected in (
            (operation(x, number), operation(X, float(number))),
            (operation(number, x), operation(float(number), X)),
        ):
            assert type(node) is Node
            assert value(node) == float(expected)


@pytest.mark.parametrize("operation", [*ARITHMETIC, *COMPARISONS])
def test_operators_between_nodes_are_those_of_floats(operation):
    assert value(operation(x, y)) == float(operation(X, Y))
    assert value(operation(x, x)) == float(operation(X, X))


def test_signs_and_abs():
    assert value(-x) == -X
    assert +x is x
    assert value(abs(-x)) == X


def test_equal_compares_values_and_not_nodes():
    assert value(cg.equal(x, X)) == value(cg.less_equal(x, X)) == value(cg.not_equal(x, y)) == 1.0
    assert value(cg.equal(x, y)) == value(cg.less(x, X)) == value(cg.not_equal(x, X)) == 0.0


@pytest.mark.parametrize("operation", [operator.add, operator.mul, operator.lt])
def test_what_is_no_number_is_a_type_error(operation):
    for wrong in ("1", None, 1j, [1.0], object()):
        for arguments in ((x, wrong), (wrong, x)):
            with pytest.raises(TypeError):
                operation(*arguments)


def test_a_complex_number_of_numpy_is_a_type_error():
    with pytest.raises(TypeError):
        np.complex128(1j) * x


@pytest.mark.parametrize(
    ("ufunc", "expected"),
    [
        (np.sin, math.sin),
        (np.exp, math.exp),
        (np.sqrt, math.sqrt),
        (np.arctan, math.atan),
        (np.negative, operator.neg),
        (np.absolute, abs),
        (np.tanh, math.tanh),
    ],
)
def test_a_function_of_numpy_on_a_node_is_a_node(ufunc, expected):
    node = ufunc(x)
    assert type(node) is Node
    assert value(node) == expected(X)


@pytest.mark.parametrize("ufunc", [np.add, np.arctan2, np.hypot, np.maximum, np.minimum, np.divide, np.power])
def test_a_function_of_two_arguments_of_numpy_takes_nodes_and_numbers(ufunc):
    for arguments, numbers in (((x, y), (X, Y)), ((x, 0.5), (X, 0.5)), ((np.float64(0.5), y), (0.5, Y))):
        assert value(ufunc(*arguments)) == pytest.approx(float(ufunc(*numbers)), rel=LAST_BITS)


def test_what_numpy_cannot_do_with_a_node_is_a_type_error():
    with pytest.raises(TypeError):
        np.spacing(x)
    with pytest.raises(TypeError):
        np.add.reduce(x)
    with pytest.raises(TypeError):
        np.sin(x, out=np.zeros(1))


ARRAY = np.array([[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize("operation", ARITHMETIC)
def test_arithmetic_with_an_array_is_element_by_element(operation):
    for nodes, expected in ((operation(x, ARRAY), operation(X, ARRAY)), (operation(ARRAY, x), operation(ARRAY, X))):
        assert nodes.shape == (2, 2)
        found = np.array([[value(node) for node in row] for row in nodes])
        assert found == pytest.approx(expected, rel=LAST_BITS)


@pytest.mark.parametrize("operation", COMPARISONS)
def test_a_comparison_with_an_array_is_element_by_element(operation):
    limits = np.array([0.5, X, 1.0])
    for nodes, expected in ((operation(x, limits), operation(X, limits)), (operation(limits, x), operation(limits, X))):
        assert [value(node) for node in nodes] == expected.astype(float).tolist()


def test_arrays_of_nodes_combine_with_nodes_numbers_and_arrays():
    nodes = np.array([x, y])
    for found, expected in (
        (nodes * x, [X * X, Y * X]),
        (x - nodes, [0.0, X - Y]),
        (nodes + nodes, [X + X, Y + Y]),
        (nodes * [2.0, 3.0], [X * 2, Y * 3]),
        (-nodes, [-X, -Y]),
    ):
        assert [value(node) for node in found] == expected


def test_matrices_times_vectors_of_nodes():
    nodes = np.array([x, y])
    assert [value(each) for each in ARRAY @ nodes] == pytest.approx([X + 2 * Y, 3 * X + 4 * Y], rel=LAST_BITS)
    assert value(nodes @ nodes) == X * X + Y * Y
    matrix = np.array([[x, y], [y, x]])
    assert [value(each) for each in matrix @ nodes] == pytest.approx([X * X + Y * Y, 2 * X * Y], rel=LAST_BITS)


def test_sum_of_nodes():
    assert value(sum([x, y])) == value(np.array([x, y]).sum()) == X + Y


def test_where_chooses_by_any_nonzero_condition():
    for condition, expected in ((1.0, X), (-0.5, X), (math.inf, X), (0.0, Y), (-0.0, Y)):
        assert value(cg.where(condition, x, y)) == expected
    assert value(cg.where(x > y, x, y)) == X
    assert value(cg.where(x < y, x, y)) == Y
