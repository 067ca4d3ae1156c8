"""Roots, logarithms, error functions, the logistic function and whole numbers: at their extremes."""

import math
from fractions import Fraction

import numpy as np
import pytest

import cgraph as cg
from cgraph.operations.bounds import intervals
from tests.cgraph.engines import ENGINES
from tests.each_row import each_row
from tests.ulps import same

INF = math.inf
x, y = cg.variables("x y")


def slope(node: cg.Node, at: float) -> float:
    return cg.gradient(cg.Graph([x], {"f": node})).evaluate({"x": at})["df/dx"]


def test_slopes_where_there_is_a_limit():
    assert slope(cg.cbrt(x), 0.0) == INF
    assert slope(cg.logistic(x), INF) == slope(cg.logistic(x), -INF) == 0.0
    assert slope(cg.erf(x), INF) == slope(cg.erfc(x), -INF) == 0.0


HALVES = [-2.5, -1.5, -0.5, -0.3, -0.0, 0.0, 0.49999999999999994, 0.5, 1.5, 2.5, 4503599627370497.5, 1e300, INF]


@pytest.mark.parametrize("backend", ENGINES)
def test_powers_of_two_and_ten_are_exact_and_whole_numbers_those_of_numpy_with_the_sign_of_zero(backend):
    graph = cg.Graph([x, y], {"2": cg.log2(x), "10": cg.log10(y), "exp2": cg.exp2(cg.log2(x))})
    powers = np.arange(-300.0, 301.0)
    tens = np.array([float(f"1e{int(k)}") for k in powers])
    assert np.array_equal(cg.compile(graph, backend).batch([2.0**powers, tens]), [powers, powers, 2.0**powers])
    function = cg.compile(cg.Graph([x], {"f": cg.floor(x), "c": cg.ceil(x), "r": cg.round(x)}), backend)
    expected = np.array([np.floor(HALVES), np.ceil(HALVES), np.rint(HALVES)])
    assert same(function.batch([HALVES]), expected)
    assert same(np.array([function([each]) for each in HALVES]).T, expected)


@each_row(("a", "b"), [(5.3, 2.0), (-5.3, 2.0), (5.3, -2.0), (1e300, 0.7), (1.0, 0.1), (0.3, 0.1)])
def test_fmod_is_exact_and_its_slope_counts_the_whole_parts(a, b):
    """Also where a / b rounds up to a whole number that it does not reach."""
    graph = cg.Graph([x, y], {"f": cg.fmod(x, y)})
    whole = math.trunc(Fraction(a) / Fraction(b))
    assert graph.evaluate({"x": a, "y": b})["f"] == float(Fraction(a) - whole * Fraction(b))
    slopes = cg.gradient(graph).evaluate({"x": a, "y": b})
    assert slopes == {"df/dx": 1.0, "df/dy": float(-whole)}


def test_numpy_and_python_make_the_nodes():
    made = [np.cbrt(x), np.floor(x), np.ceil(x), np.rint(x), np.log2(x), np.log10(x), np.exp2(x), np.fmod(x, y)]
    assert [node.op.name for node in made] == "cbrt floor ceil round log2 log10 exp2 fmod".split()
    made = [math.floor(x), math.ceil(x), round(x), np.round(x)]
    assert [node.op.name for node in made] == "floor ceil round round".split()
    special = pytest.importorskip("scipy.special")
    assert [special.erf(x).op.name, special.erfc(x).op.name, special.expit(x).op.name] == ["erf", "erfc", "logistic"]


def test_arrays_of_nodes_go_through_ufuncs_element_by_element():
    nodes = np.array([[x, y]])
    for ufunc, name in ((np.sqrt, "sqrt"), (np.sin, "sin"), (np.arctan, "atan"), (np.cbrt, "cbrt"), (np.rint, "round")):
        assert [node.op.name for node in ufunc(nodes)[0]] == [name] * 2
    turned = np.arctan2(nodes, nodes[:, ::-1])[0]
    assert [(node.op.name, node.args) for node in turned] == [("atan2", (x, y)), ("atan2", (y, x))]
    with pytest.raises(AttributeError, match="no attribute 'spacing'"):
        x.spacing()


def test_folding_of_signs_and_of_whole_numbers():
    graph = cg.simplify(
        cg.Graph(
            [x], {"a": cg.cbrt(-x) + cg.cbrt(x), "b": cg.erf(-x) + cg.erf(x), "c": cg.floor(cg.ceil(x)) - cg.ceil(x)}
        )
    )
    assert [node.value for node in graph.outputs.values()] == [0.0] * 3


@each_row(
    ("node", "box", "expected"),
    [
        (cg.fmod(x, 3.0), (0.5, 2.5), (0.5, 2.5)),
        (cg.fmod(x, 3.0), (-25.0, 25.0), (-3.0, 3.0)),
        (cg.fmod(x, 3.0), (-1.0, 2.0), (-1.0, 2.0)),
        (cg.fmod(x, -3.0), (1.0, 25.0), (0.0, 3.0)),
        (cg.floor(x), (-0.5, 2.5), (-1.0, 2.0)),
        (cg.round(x), (0.5, 2.5), (0.0, 2.0)),
        (cg.logistic(x), (-INF, INF), (0.0, 1.0)),
    ],
)
def test_bounds(node, box, expected):
    assert intervals(cg.Graph([x], {"f": node}).nodes, {"x": box})[node] == expected
