"""Every model's equations against Lagrange's equation by 80-digit differences of L: no AD in the reference."""

import numpy as np
from pytest import approx, mark

import dynamics as dyn
from cgraph.extend import topological
from dynamics import as_system
from tests.dynamics.lagrange_by_mpmath import floats, lagrange
from tests.dynamics.models import MODELS, at, run, states
from tests.each_row import each_row
from tests.formulations import WITHOUT_STEP

ROUNDING = 1e-13  # of the largest term: the same rounding in models of a few hundred operations


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
    parts = system.graph({"L": system.lagrangian, "K": system.kinetic, "P": system.potential}, system.q, system.qd)
    whole, kinetic, potential = run(parts, state)
    assert kinetic - potential == approx(whole, rel=ROUNDING, abs=ROUNDING)
    assert not set(system.qd) & set(topological([system.potential]))
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
