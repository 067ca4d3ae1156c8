"""Values at states given as arrays: one state or many, and errors that name the coordinate."""

import math

import numpy as np
import pytest

import dynamics as dyn
from dynamics.equations.states.evaluate import evaluate


def slider() -> dyn.System:
    """Two coordinates of one mass each, the second damped."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2), ["rail", "elbow"], {"m": 2.0}, damping=[0, 1]
    )


def test_what_is_left_out_is_zero_and_parameters_have_the_system_s_values() -> None:
    system = slider()
    graph = dyn.inverse_dynamics(system)
    assert evaluate(system, graph, {"q": [1.0, 1.0], "qdd": [3.0, 0.0]}).tolist() == [6.0, 0.0]
    assert evaluate(system, graph, {"qd": [0.0, 4.0]}, parameters={"m": 5.0}).tolist() == [0.0, 4.0]


def test_one_state_beside_many_serves_them_all() -> None:
    system = slider()
    many = evaluate(system, dyn.inverse_dynamics(system), {"qd": [0.0, 1.0], "qdd": np.eye(2)})
    assert many.tolist() == [[2.0, 1.0], [0.0, 3.0]]


@pytest.mark.parametrize(
    ("state", "words"),
    [
        ({"q": [0.0, math.nan]}, "q must be finite, got nan for 'elbow'$"),
        ({"qd": [[0.0, 0.0], [math.inf, 0.0]]}, "qd must be finite, got inf for 'rail' in row 1"),
        ({"qdd": [0.0]}, r"qdd must have the shape \(2,\) or \(N, 2\), one number for each of rail, elbow; got \(1,\)"),
    ],
)
def test_wrong_numbers_are_named_with_their_coordinate(state: dict[str, object], words: str) -> None:
    system = slider()
    with pytest.raises(ValueError, match=words):
        evaluate(system, dyn.inverse_dynamics(system), state)
