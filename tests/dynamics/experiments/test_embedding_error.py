"""The law of the flawed formulations: what they tend to as dt -> 0, and how fast."""

import numpy as np
from mpmath import mp
from pytest import approx, mark

import dynamics as dyn
from dynamics.systems.model import as_system
from tests import high_precision
from tests.dynamics.lagrange_by_mpmath import floats, lagrange
from tests.dynamics.models import MODELS, at, before, named, random_arm, run, states
from tests.each_row import each_row

DTS = np.geomspace(1e-4, 1e-6, 5)  # s: the second-order term is then below 1e-3 of the first
SLOPE = 0.02  # of a line through logarithms, whose curvature over DTS is the second-order term
ROUNDING = 1e-13


@mark.parametrize("dt", [1e-6, 1e-3, 0.1, 1.0])
@each_row(("formulation", "n"), [("kinetic_only", 1), *[("kinetic_only_exact", n) for n in (1, 2, 3, 6)]])
def test_kinetic_only_is_right_at_any_dt_for_one_joint_and_before_the_embedding(
    formulation: str, n: int, dt: float
) -> None:
    arm = random_arm(n, seed=4)
    state = at(states(arm, 1, seed=4), 0)
    terms, tau = lagrange(arm, state), run(dyn.inverse_dynamics(arm, formulation), before(state, dt))
    assert tau == approx(floats(terms.tau), rel=0.0, abs=ROUNDING * terms.largest)


@each_row("name", MODELS)
def test_by_definition_the_torque_tends_to_tau_and_dl_dq_and_of_k_alone_to_tau_and_dk_dq(name: str) -> None:
    """With explicit time, terms linear in velocity, damping and forces; in first order where it is not so at once."""
    model = MODELS[name]()
    state = at(states(model, 1, seed=6), 0)
    of_l, of_k = lagrange(model, state), lagrange(model, state, energy=as_system(model).kinetic)
    limits = {
        "by_definition": floats(of_l.tau) + floats(of_l.gradient),
        "kinetic_only": floats(of_l.tau) + floats(of_k.gradient),
        "kinetic_only_exact": floats(of_l.tau),
    }
    for formulation, limit in limits.items():
        graph = dyn.inverse_dynamics(model, formulation)
        errors = [np.linalg.norm(run(graph, before(state, dt)) - limit) for dt in DTS.tolist()]
        assert errors[-1] < 1e-4 * of_l.largest, formulation
        if errors[-1] > 1e3 * ROUNDING * of_l.largest:
            order = np.polyfit(np.log(DTS), np.log(errors), 1)[0]
            assert order == approx(1.0, abs=SLOPE), formulation


def test_the_right_torque_is_not_what_the_flawed_ones_give_at_a_large_step() -> None:
    """At dt = 0.1 s the law is no excuse: the flawed torque is the derivative by definition, exactly."""
    system, dt = as_system(random_arm(2)), 0.1
    state = at(states(system, 1, seed=8), 0)
    old = before(state, dt)
    graph = system.graph({"L": system.lagrangian}, system.q, system.qd)
    with mp.workdps(80):
        h = mp.mpf(10) ** -18
        x = {name: mp.mpf(float(value)) for name, value in named(old).items()}

        def lagrangian(i: int, a: int, b: int) -> mp.mpf:
            at_dt = x["dt"] + a * h
            qd = [x[f"qdd{j}"] * at_dt + x[f"qd{j}_old"] + (b * h if j == i else 0) for j in range(2)]
            q = [qd[j] * at_dt + x[f"q{j}_old"] for j in range(2)]
            point = {f"q{j}": q[j] for j in range(2)} | {f"qd{j}": qd[j] for j in range(2)}
            return high_precision.evaluate(graph, point, 80)["L"]

        expected = [
            float(sum(a * b * lagrangian(i, a, b) for a in (1, -1) for b in (1, -1)) / (4 * h * h)) for i in range(2)
        ]
    found = run(dyn.momentum_rate(system, "by_definition"), old)
    assert found == approx(np.array(expected), rel=1e-12)
