"""The library in a page: what a newcomer reads first."""

import math

import numpy as np
from pytest import approx

import cgraph as cg
from tests.tolerances import SHORT_SUM


def test_a_graph_evaluates_what_was_written():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": cg.sin(x) * y + 2})
    assert graph.evaluate({"x": 0.3, "y": -0.7}) == {"f": math.sin(0.3) * -0.7 + 2}


def test_arrays_evaluate_element_by_element():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": x * y, "g": x + 1})
    result = graph.evaluate({"x": np.array([1.0, 2.0, 3.0]), "y": 10.0})
    assert result["f"].tolist() == [10.0, 20.0, 30.0]
    assert result["g"].tolist() == [2.0, 3.0, 4.0]


def test_gradient_agrees_with_the_complex_step():
    x, y = cg.variables("x y")
    gradient = cg.gradient(cg.Graph([x, y], {"f": cg.exp(x) * cg.sin(y) / x}))

    def f(x: complex, y: complex) -> complex:
        return np.exp(x) * np.sin(y) / x

    h = 1e-30  # no subtraction, so no cancellation
    expected = {"df/dx": f(0.3 + h * 1j, 0.7).imag / h, "df/dy": f(0.3, 0.7 + h * 1j).imag / h}
    assert gradient.evaluate({"x": 0.3, "y": 0.7}) == approx(expected, rel=SHORT_SUM)


def test_forward_and_reverse_mode_meet_in_the_second_derivative():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"f": x * x * y})
    hessian = cg.hessian(graph).evaluate({"x": 2.0, "y": 5.0})
    assert hessian == {"d2f/dxdx": 10.0, "d2f/dxdy": 4.0, "d2f/dydx": 4.0, "d2f/dydy": 0.0}


def test_a_derivative_is_a_graph_that_can_be_counted_and_read():
    x = cg.variable("x")
    with cg.tag("oscillator"):
        energy = cg.Graph([x], {"f": cg.sin(x) * 3})
    assert (energy.counts().nodes, energy.counts().edges) == (4, 3)
    assert cg.gradient(energy).listing() == (
        "inputs x\n%1 = cos x  # adjoint; oscillator\n%2 = mul 3.0 %1  # adjoint; oscillator\noutput df/dx = %2\n"
    )


def test_simplify_leaves_the_function_and_takes_the_rest():
    x = cg.variable("x")
    graph = cg.Graph([x], {"f": (x + 0) * 1 + (cg.sin(x) - cg.sin(x))})
    assert cg.simplify(graph).listing() == "inputs x\noutput f = x\n"


def test_specialize_binds_an_input():
    x, k = cg.variables("x k")
    spring = cg.specialize(cg.Graph([x, k], {"energy": k * x**2 / 2}), {"k": 3.0})
    assert spring.input_names == ("x",)
    assert spring.evaluate({"x": 2.0}) == {"energy": 6.0}
