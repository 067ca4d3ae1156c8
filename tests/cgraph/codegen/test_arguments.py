"""The same sentence for the same bad argument in every engine, and the same values of odd graphs."""

import math
from fractions import Fraction

import numpy as np
import pytest

import cgraph as cg
from tests.ulps import same

x, y = cg.variables("x y")
GRAPH = cg.Graph([x, y], {"a": x * y, "b": x + y})
ENGINES = ["python", "numpy", "llvm"]


@pytest.fixture(params=ENGINES)
def engine(request):
    if request.param == "llvm":
        pytest.importorskip("llvmlite")
    return request.param


@pytest.mark.parametrize("number", [True, Fraction(1, 3), np.float32(1.5), np.longdouble(1.5), np.int8(3)], ids=repr)
def test_every_real_number_is_taken(engine, number):
    expected = [2.0 * float(number), float(number) + 2.0]
    assert list(GRAPH.evaluate({"x": number, "y": 2}).values()) == expected
    assert cg.compile(GRAPH, engine)([number, 2]).tolist() == expected
    assert cg.compile(GRAPH, engine).batch([[number], [2]])[:, 0].tolist() == expected


BAD = {
    "must be real numbers, got text": ["a", 1.0],
    "must be real numbers, got NoneType: None": [None, 1.0],
    "must be real numbers, got complex numbers": [1j, 1.0],
    "must be real numbers, got one that is too large for float64": [10**400, 1.0],
    "must be real numbers, got an array with masked values": [np.ma.masked, 1.0],
}


@pytest.mark.parametrize("sentence", BAD)
def test_what_is_no_real_number_is_told_in_the_same_words(engine, sentence):
    first, second = BAD[sentence]
    function = cg.compile(GRAPH, engine)
    for call in (
        lambda: GRAPH.evaluate({"x": first, "y": second}),
        lambda: function([first, second]),
        lambda: function.batch([first, second]),
    ):
        with pytest.raises((TypeError, ValueError), match=sentence):
            call()


def test_numbers_too_large_are_told_of_constants_and_fractions():
    with pytest.raises(ValueError, match="must fit float64, got 1000"):
        x * 10**400
    with pytest.raises(ValueError, match="too large for float64"):
        GRAPH.evaluate({"x": Fraction(10**400), "y": 1.0})


@pytest.mark.parametrize("option", ["fast", "fma"])
@pytest.mark.parametrize("value", ["no", 1, None])
def test_an_option_that_is_no_truth_value_is_told(engine, option, value):
    with pytest.raises(TypeError, match=f"{option} must be True or False, got {value!r}"):
        cg.compile(GRAPH, engine, **{option: value})
    assert cg.compile(GRAPH, engine, **{option: np.False_}).options[option] is False


def test_a_cache_in_the_home_is_not_a_folder_called_tilde(engine, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    function = cg.compile(GRAPH, engine, cache="~/code")
    assert function.options["cache"] == str(tmp_path / "code")
    assert cg.clear_cache("~/code") == (engine == "llvm")


@pytest.mark.parametrize("threads", [True, False, 0, 1.5, "2"])
def test_threads_that_are_no_number_are_told(engine, threads):
    with pytest.raises(ValueError, match="threads must be a whole number from 1, or None"):
        cg.compile(GRAPH, engine).batch(np.ones((2, 3)), threads=threads)


@pytest.mark.parametrize("values", [[1, 2], 3.0, None])
def test_evaluate_takes_a_mapping(values):
    with pytest.raises(TypeError, match=r"evaluate takes a mapping \{input: value\}, got"):
        GRAPH.evaluate(values)
    with pytest.raises(cg.GraphError, match="the graph has no input 1"):
        GRAPH.evaluate({"x": 1.0, "y": 2.0, 1: 3.0})


def test_outputs_share_memory_with_nothing():
    product = x * y
    graph = cg.Graph([x, y], {"p": product, "q": product, "x": x, "again": x, "c": cg.constant(2.0), "d": 2.0})
    for point in (
        {"x": np.ones(3), "y": np.ones(3)},
        {"x": np.ones(3), "y": 2.0},
        {"x": np.ones((2, 1)), "y": np.ones(3)},
    ):
        kept = {name: np.array(value) for name, value in point.items()}
        arrays = [*graph.evaluate(point).values()]
        given = [value for value in point.values() if isinstance(value, np.ndarray)]
        for k, array in enumerate(arrays):
            assert not any(np.shares_memory(array, other) for other in [*arrays[:k], *given])
            array[:] = -1.0
        assert all(np.array_equal(point[name], kept[name]) for name in point)


def test_odd_graphs_have_the_same_values_in_every_engine(engine):
    """Inputs that nothing uses, outputs that are one node, constants of every kind."""
    z = cg.variable("z")
    nan = cg.constant(math.inf) - cg.constant(math.inf)
    outputs = {
        "x": x,
        "twice": x,
        "large": x * 1e308,
        "zero": cg.constant(-0.0),
        "inf": -math.inf,
        "nan": nan,
        "s": x - nan,
    }
    graph = cg.Graph([z, x, y], outputs | {"signed": x * -0.0, "small": x + 5e-324})
    function = cg.compile(graph, engine)
    points = np.array([[1.0, 0.0, 3.0], [-2.0, -0.0, 3.0], [9.0, 2.5, math.nan]]).T
    for point in points.T.tolist():
        expected = list(graph.evaluate(dict(zip("zxy", point, strict=True))).values())
        assert same(function(point), expected)
        assert same(function.batch(np.array(point)[:, None])[:, 0], expected)
    unused = cg.Graph([x, y], {"c": 3.0})
    assert cg.compile(unused, engine)([math.nan, 10.0]).tolist() == [3.0]
    assert cg.compile(unused, engine).batch(np.ones((2, 0))).shape == (1, 0)
