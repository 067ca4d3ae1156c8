"""`to_casadi`: values and derivatives of every operation, of random graphs and of an arm, in CasADi."""

import numpy as np
import pytest
from hypothesis import given, settings

import cgraph as cg
from tests.cgraph.bridges.agreement import ARM, POINT, SLOPES, Bridge, agrees, disagreements, lets_zero_win, refuses
from tests.strategies import cases, examples
from tests.tolerances import EQUATIONS

casadi = pytest.importorskip("casadi")


def jacobian(graph):
    function = cg.to_casadi(graph)
    x = casadi.SX.sym("x", function.numel_in(0))
    return casadi.Function("slopes", [x], [casadi.jacobian(function(x), x)])


BRIDGE = Bridge(cg.to_casadi, jacobian)


def test_every_operation_but_erfc_has_its_value_and_its_slopes():
    assert disagreements(BRIDGE, "erfc") == {}
    x = cg.variable("x")
    with pytest.raises(cg.GraphError, match="CasADi has no operation 'erfc'"):
        cg.to_casadi(cg.Graph([x], {"y": cg.erfc(x)}))


@settings(max_examples=examples(100))
@given(cases().filter(lambda case: all(node.op.name != "erfc" for node in case.graph.nodes)))
def test_a_random_graph_has_its_values(case):
    agrees(BRIDGE, case)


def test_an_exact_zero_wins_and_halves_go_to_the_even_number():
    x, y = cg.variables("x y")
    graph = cg.Graph([x, y], {"where": cg.where(x > 0.0, cg.log(x), y), "round": cg.round(y)})
    assert np.array(cg.to_casadi(graph)([0.0, 2.5])).ravel().tolist() == [2.5, 2.0]
    assert np.array(cg.to_casadi(graph)([1.0, -1.5])).ravel().tolist() == [0.0, -2.0]
    lets_zero_win(BRIDGE)


def test_values_are_those_that_are_written_and_slopes_do_not_overflow_on_the_way():
    x = cg.variable("x")
    written = {
        "sum": (x + 1e16) - 1e16,
        "gone": x - x,
        "root": cg.sqrt(x) * cg.sqrt(x),
        "zero": 0.0 * x,
        "same": cg.equal(x, x),
    }
    graph, simplifies = cg.Graph([x], written), casadi.GlobalOptions.getSimplificationOnTheFly()
    for point in (3.0, np.inf, np.nan):
        wanted = list(graph.evaluate({"x": point}).values())
        np.testing.assert_array_equal(np.array(cg.to_casadi(graph)(point)).ravel(), wanted)
    assert casadi.GlobalOptions.getSimplificationOnTheFly() == simplifies
    slope = jacobian(cg.Graph([x], {"y": cg.logistic(x)}))
    for point in (-710.0, -37.0, 0.0, 1.0, 710.0):
        e = np.exp(-abs(point))
        assert float(slope(point)) == pytest.approx(e / (1.0 + e) ** 2, rel=SLOPES)


def test_an_arm_and_its_jacobian_and_the_names_of_its_function():
    function, fn = cg.to_casadi(ARM, "arm"), cg.compile(ARM, "python")
    assert (function.name(), function.name_in(), function.name_out()) == ("arm", ["x"], ["y"])
    assert np.array(function(POINT)).ravel() == pytest.approx(fn(POINT), rel=EQUATIONS)
    slopes = fn.jacobian(POINT)
    assert np.abs(np.array(jacobian(ARM)(POINT)) - slopes).max() < EQUATIONS * np.abs(slopes).max()


def test_what_casadi_cannot_take_is_told():
    refuses(cg.to_casadi, "CasADi")
    for name in ("2x", "a b", "a__b", "", 3):
        with pytest.raises(ValueError, match="name must be letters"):
            cg.to_casadi(ARM, name)
