"""Every model's equations against Lagrange's equation by 80-digit differences of L: no AD in the reference."""

import numpy as np
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics import as_system
from tests.dynamics.lagrange_by_mpmath import Terms, floats, lagrange
from tests.dynamics.models import MODELS, Array, at, random_arm, run, states
from tests.each_row import each_row
from tests.formulations import WITHOUT_STEP

STATES = 20
ULPS = 100  # of the largest term: some 170 operations, each off by half an ulp of something no larger
ROUNDING = 1e-13  # of the largest term: the same rounding in models of a few hundred operations
WRONG_DIGIT = 1e-13  # of a mass: some 450 ulp, more than ULPS lets pass


def ulps(value: Array, terms: Terms) -> float:
    return float(np.abs(value - floats(terms.tau)).max() / np.spacing(terms.largest))


@mark.parametrize("model", ["rod", "point"])
@mark.parametrize("formulation", WITHOUT_STEP)
def test_torques_of_three_links_are_right_to_100_ulp(formulation: str, model: str) -> None:
    arm = random_arm(3, seed=5, model=model)
    graph = dyn.inverse_dynamics(arm, formulation)
    function, many = cg.compile(graph), states(arm, STATES, seed=5)
    for row in range(STATES):
        state = at(many, row)
        terms = lagrange(arm, state)
        assert ulps(run(graph, state), terms) < ULPS
        assert ulps(function(np.concatenate([state["q"], state["qd"], state["qdd"]])), terms) < ULPS


def test_a_hundred_ulp_is_a_bound_that_a_wrong_parameter_breaks() -> None:
    """A mass wrong in the thirteenth digit is seen."""
    masses, lengths = [1.0, 0.8, 0.7], [1.0, 0.8, 0.7]
    arm, other = dyn.planar_arm(masses, lengths), dyn.planar_arm([1.0, 0.8, 0.7 * (1 + WRONG_DIGIT)], lengths)
    state = at(states(arm, 1), 0)
    assert ulps(run(dyn.inverse_dynamics(arm), state), lagrange(arm, state)) < ULPS
    assert ulps(run(dyn.inverse_dynamics(other), state), lagrange(arm, state)) > ULPS


@mark.parametrize("formulation", WITHOUT_STEP)
@mark.parametrize("name", MODELS)
def test_torque_is_lagrange_s_equation(name: str, formulation: str) -> None:
    model = MODELS[name]()
    graph, many = dyn.inverse_dynamics(model, formulation), states(model, 3)
    for row in range(3):
        state = at(many, row)
        terms = lagrange(model, state)
        assert run(graph, state) == approx(floats(terms.tau), rel=0.0, abs=ROUNDING * terms.largest)


@each_row("name", MODELS)
def test_momentum_its_rate_and_the_gravity_force_are_dl_dqd_its_rate_and_dp_dq(name: str) -> None:
    """At rest, d/dt dL/dqd has no part of P, and for a Lagrangian without time or B is zero; then tau = dP/dq."""
    system = as_system(MODELS[name]())
    state = at(states(system, 1), 0)
    terms = lagrange(system, state)
    assert run(dyn.momentum(system), state) == approx(floats(terms.momentum), rel=ROUNDING, abs=ROUNDING)
    expected = approx(floats(terms.momentum_rate), rel=0.0, abs=ROUNDING * terms.largest)
    assert run(dyn.momentum_rate(system), state) == expected
    rest = {**state, "qd": np.zeros(system.n), "qdd": np.zeros(system.n)}
    terms = lagrange(system, rest)
    of_p = floats(lagrange(system, rest, energy=system.potential).gradient)
    size = ROUNDING * max(terms.largest, 1.0)
    if name != "driven pendulum":  # its pivot shakes at rest too
        assert run(dyn.gravity_force(system), state) == approx(of_p, rel=0.0, abs=size)
    at_rest = floats(terms.momentum_rate) - floats(terms.gradient)
    assert run(dyn.gravity_force(system), state) == approx(at_rest, rel=0.0, abs=size)
