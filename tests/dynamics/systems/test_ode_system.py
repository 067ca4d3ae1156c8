"""First-order systems and the state equation: what they give, and what they say about wrong input."""

import numpy as np
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import OdeSystem, state_equation
from dynamics.equations.state_equation import state_inputs
from tests.dynamics.models import MODELS, at, inputs, states


def lotka_volterra() -> OdeSystem:
    return OdeSystem(lambda x, t, p: [p["a"] * x[0] - x[0] * x[1], x[0] * x[1] - x[1]], ["hares", "lynxes"], {"a": 1.5})


def test_graph_has_the_states_as_inputs_and_their_rates_as_outputs() -> None:
    graph = lotka_volterra().graph
    graph.check()
    assert graph.input_names == ("hares", "lynxes", "a")
    assert list(graph.outputs) == ["hares_dot", "lynxes_dot"]
    assert graph.evaluate({"hares": 2.0, "lynxes": 0.5, "a": 1.5}) == {"hares_dot": 2.0, "lynxes_dot": 0.5}


def test_time_is_an_input_when_a_rate_depends_on_it() -> None:
    driven = OdeSystem(lambda x, t: [cg.cos(t), 1.0], "x y")
    assert driven.graph.input_names == ("x", "y", "t")
    assert driven.graph.evaluate({"x": 0.0, "y": 0.0, "t": 0.0}) == {"x_dot": 1.0, "y_dot": 1.0}
    assert state_inputs(driven).timed
    assert not state_inputs(lotka_volterra()).timed


def test_a_rate_may_be_a_number_or_come_from_arrays() -> None:
    matrix = np.array([[0.0, 1.0], [-4.0, 0.0]])
    linear = OdeSystem(lambda x, t: matrix @ np.array(x), "x v")
    assert linear.graph.evaluate({"x": 1.0, "v": 3.0}) == {"x_dot": 3.0, "v_dot": -4.0}


def test_its_state_equation_is_its_own() -> None:
    system = lotka_volterra()
    assert state_equation(system) is system.graph
    assert state_inputs(system) == (("hares", "lynxes"), (), False, {"a": 1.5})


@mark.parametrize("name", MODELS)
def test_state_equation_of_a_mechanical_model_is_velocities_and_accelerations(name: str) -> None:
    model = MODELS[name]()
    graph, accelerations = state_equation(model), dyn.forward_dynamics(model)
    given = state_inputs(model)
    n = len(given.applied)
    assert list(graph.outputs) == [f"{each}_dot" for each in given.states]
    assert graph.input_names == accelerations.input_names
    assert graph.input_names == (*given.states, *given.applied, *(["t"] if given.timed else []), *given.parameters)
    values = inputs(graph, at(states(model, 1), 0))
    rates = graph.evaluate(values)
    assert [rates[f"q{i}_dot"] for i in range(n)] == [values[f"qd{i}"] for i in range(n)]
    assert [rates[f"qd{i}_dot"] for i in range(n)] == list(accelerations.evaluate(values).values())


@mark.parametrize("method", ["dop853", "rodas", "radau"])
def test_a_tank_runs_empty_and_stays_so(method: str) -> None:
    """h = (1 - t/2)^2, then 0. Beyond the kink the slope of the rate is 0, not 0 times infinity."""
    tank = OdeSystem(lambda x, t: [-cg.sqrt(cg.maximum(x[0], 0.0))], ["h"])
    run = dyn.simulate(tank, [1.0], None, t_end=4.0, method=method, rtol=1e-8, atol=1e-10)
    assert run.t[-1] == 4.0
    assert abs(run.q[-1, 0]) < 1e-8


@mark.parametrize(
    ("rate", "names", "parameters", "error", "words"),
    [
        (lambda x, t: [x[0]], "x y", {}, ValueError, "must give 2 values, one for each of x, y; got 1"),
        (lambda x, t: x[0], "x", {}, TypeError, "rate must give a sequence"),
        (lambda x, t: ["1"], "x", {}, TypeError, "the rate of 'x' must be a node or a number"),
        (lambda x, t: [float("nan")], "x", {}, ValueError, "the rate of 'x' must be a node or a number"),
        (lambda x: [x[0]], "x", {}, TypeError, r"must take \(x, t\) or \(x, t, p\)"),
        (None, "x", {}, TypeError, "must be a function"),
        (lambda x, t: [cg.variable("z")], "x", {}, ValueError, r"'z', which is no state, parameter or t \(it has x\)"),
        (lambda x, t: [x[0]], "", {}, ValueError, "at least one state"),
        (lambda x, t: [x[0]], [1], {}, TypeError, "name of a state must be a string, got int: 1"),
        (lambda x, t: [x[0]], "x x", {}, ValueError, "must differ"),
        (lambda x, t: [x[0]], "t", {}, ValueError, "name of time"),
        (lambda x, t, p: [x[0]], "x", {"x": 1.0}, ValueError, "both a state and a parameter"),
        (lambda x, t, p: [x[0]], "x", {"k": "1"}, ValueError, "parameter 'k' must be a finite number"),
    ],
)
def test_wrong_input_is_named(rate: object, names: object, parameters: dict, error: type, words: str) -> None:
    with raises(error, match=words):
        OdeSystem(rate, names, parameters)  # type: ignore[arg-type]
