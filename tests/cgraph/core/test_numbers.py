"""Numbers and arrays on either side of a node, and the operators of Python on nodes."""

import math
import operator
from fractions import Fraction

import numpy as np
import pytest

import cgraph as cg
from cgraph.core.node import Node
from tests.each_row import each_row
from tests.tolerances import LAST_BITS

x, y = cg.variables("x y")
X, Y = 0.7, 0.4  # their values


def value(node: Node) -> float:
    return cg.Graph([x, y], {"f": node}).evaluate({"x": X, "y": Y})["f"]


NUMBERS = [2, 2.5, True, Fraction(3, 2), np.float64(1.5), np.float32(1.5), np.int64(3), np.uint8(3), np.array(1.5)]
ARITHMETIC = [operator.add, operator.sub, operator.mul, operator.truediv, operator.pow]
COMPARISONS = [operator.lt, operator.le, operator.gt, operator.ge]
ARRAY = np.array([[1.0, 2.0], [3.0, X]])


@each_row("operation", [*ARITHMETIC, *COMPARISONS])
def test_an_operator_takes_numbers_on_either_side_and_arrays_element_by_element(operation):
    assert value(operation(x, y)) == float(operation(X, Y))
    assert value(operation(x, x)) == float(operation(X, X))
    for nodes, expected in ((operation(x, ARRAY), operation(X, ARRAY)), (operation(ARRAY, x), operation(ARRAY, X))):
        assert nodes.shape == (2, 2)
        found = np.array([[value(node) for node in row] for row in nodes])
        assert found == pytest.approx(expected.astype(float), rel=LAST_BITS)
    for number in (*NUMBERS, X):
        for node, expected in (
            (operation(x, number), operation(X, float(number))),
            (operation(number, x), operation(float(number), X)),
        ):
            assert type(node) is Node
            assert value(node) == float(expected)


def test_signs_and_abs():
    assert value(-x) == -X
    assert +x is x
    assert value(abs(-x)) == X


@each_row("operation", [operator.add, operator.mul, operator.lt])
def test_what_is_no_number_is_a_type_error(operation):
    for wrong in ("1", None, 1j, [1.0], object()):
        for arguments in ((x, wrong), (wrong, x)):
            with pytest.raises(TypeError):
                operation(*arguments)
    with pytest.raises(TypeError):
        np.complex128(1j) * x


FUNCTIONS = {
    np.sin: math.sin, np.exp: math.exp, np.sqrt: math.sqrt, np.arctan: math.atan, np.negative: operator.neg,
    np.absolute: abs, np.tanh: math.tanh,
}  # fmt: skip


def test_functions_of_numpy_take_nodes_and_numbers():
    for ufunc, expected in FUNCTIONS.items():
        assert type(ufunc(x)) is Node
        assert value(ufunc(x)) == expected(X), ufunc
    for ufunc in (np.add, np.arctan2, np.hypot, np.maximum, np.minimum, np.divide, np.power):
        for arguments, numbers in (((x, y), (X, Y)), ((x, 0.5), (X, 0.5)), ((np.float64(0.5), y), (0.5, Y))):
            assert value(ufunc(*arguments)) == pytest.approx(float(ufunc(*numbers)), rel=LAST_BITS), ufunc


def test_what_numpy_cannot_do_with_a_node_is_a_type_error():
    with pytest.raises(TypeError):
        np.spacing(x)
    with pytest.raises(TypeError):
        np.add.reduce(x)
    with pytest.raises(TypeError):
        np.sin(x, out=np.zeros(1))


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
    assert value(sum([x, y])) == value(nodes.sum()) == X + Y


def test_matrices_times_vectors_of_nodes():
    nodes = np.array([x, y])
    assert [value(each) for each in ARRAY @ nodes] == pytest.approx([X + 2 * Y, 3 * X + X * Y], rel=LAST_BITS)
    assert value(nodes @ nodes) == X * X + Y * Y
    matrix = np.array([[x, y], [y, x]])
    assert [value(each) for each in matrix @ nodes] == pytest.approx([X * X + Y * Y, 2 * X * Y], rel=LAST_BITS)
