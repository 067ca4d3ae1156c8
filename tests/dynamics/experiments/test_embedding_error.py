"""The law of the flawed formulations: what they tend to as dt -> 0, and how fast."""

import numpy as np
from mpmath import mp
from pytest import approx, fixture, mark

import dynamics as dyn
from dynamics.systems.model import as_system
from tests import high_precision
from tests.dynamics.lagrange_by_mpmath import floats, lagrange
from tests.dynamics.models import MODELS, Array, at, before, named, random_arm, run, states
from tests.each_row import each_row

DTS = np.geomspace(1e-4, 1e-6, 5)  # s: the second-order term is then below 1e-3 of the first
SLOPE = 0.02  # of a line through logarithms, whose curvature over DTS is the second-order term
ROUNDING = 1e-13
SIZES = (1, 2, 3, 6)


class Case:
    """An arm at one state, with the right torque and the gradients of L and K from differences at 80 digits."""

    def __init__(self, n: int) -> None:
        self.arm = random_arm(n, seed=4)
        self.state = at(states(self.arm, 1, seed=4), 0)
        of_l = lagrange(self.arm, self.state)
        of_k = lagrange(self.arm, self.state, energy=as_system(self.arm).kinetic)
        self.tau, self.dl_dq, self.dk_dq = floats(of_l.tau), floats(of_l.gradient), floats(of_k.gradient)
        self.largest = of_l.largest

    def errors(self, formulation: str, limit: Array) -> Array:
        """Distance from the limit, for each dt, between the torque and what it should tend to."""
        graph = dyn.inverse_dynamics(self.arm, formulation)
        return np.array([np.linalg.norm(run(graph, before(self.state, dt)) - limit) for dt in DTS.tolist()])


@fixture(scope="module", params=SIZES, ids=lambda n: f"{n} links")
def case(request) -> Case:
    return Case(request.param)


def slope(errors: Array) -> float:
    return float(np.polyfit(np.log(DTS), np.log(errors), 1)[0])


def test_by_definition_the_torque_tends_to_tau_and_dl_dq_and_of_k_alone_to_tau_and_dk_dq(case: Case) -> None:
    ways = [("by_definition", case.dl_dq, 1e-4), ("kinetic_only", case.dk_dq, 1e-3)]
    for formulation, gained, bound in ways if len(case.tau) > 1 else ways[:1]:  # dK/dq of one joint is zero
        errors = case.errors(formulation, case.tau + gained)
        assert slope(errors) == approx(1.0, abs=SLOPE), formulation
        assert errors[-1] < bound * np.linalg.norm(gained), formulation


@mark.parametrize("dt", [1e-6, 1e-3, 0.1, 1.0])
@each_row(("formulation", "n"), [("kinetic_only", 1), *[("kinetic_only_exact", n) for n in SIZES]])
def test_kinetic_only_is_right_at_any_dt_for_one_joint_and_before_the_embedding(
    formulation: str, n: int, dt: float
) -> None:
    case = Case(n)
    tau = run(dyn.inverse_dynamics(case.arm, formulation), before(case.state, dt))
    assert tau == approx(case.tau, rel=0.0, abs=ROUNDING * case.largest)


@each_row("name", MODELS)
def test_the_limits_hold_for_any_lagrangian(name: str) -> None:
    """With explicit time, terms linear in velocity, damping and forces; at dt = 1e-7 s, an error of first order."""
    first_order = 1e-5
    model = MODELS[name]()
    state = at(states(model, 1, seed=6), 0)
    of_l, of_k = lagrange(model, state), lagrange(model, state, energy=as_system(model).kinetic)
    limits = {
        "by_definition": floats(of_l.tau) + floats(of_l.gradient),
        "kinetic_only": floats(of_l.tau) + floats(of_k.gradient),
        "kinetic_only_exact": floats(of_l.tau),
    }
    for formulation, limit in limits.items():
        tau = run(dyn.inverse_dynamics(model, formulation), before(state, 1e-7))
        assert tau == approx(limit, rel=0.0, abs=first_order * of_l.largest), formulation


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
