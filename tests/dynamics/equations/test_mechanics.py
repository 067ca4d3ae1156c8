"""Truths of mechanics, for every model: no second implementation is needed."""

from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics import System, as_system
from tests.dynamics.models import MODELS, cart_pendulum, error, random_arm, run, states

STATES = 50
ROUNDING = 1e-12  # sums of terms that may cancel tenfold


@mark.parametrize("name", MODELS)
def test_kinetic_minus_potential_is_the_lagrangian(name: str) -> None:
    system = as_system(MODELS[name]())
    state = states(system, STATES)
    graph = system.graph({"K": system.kinetic, "P": system.potential, "L": system.lagrangian}, system.q, system.qd)
    kinetic, potential, lagrangian = run(graph, state).T
    assert kinetic - potential == approx(lagrangian, rel=ROUNDING, abs=ROUNDING)
    assert not set(system.qd) & set(cg.Graph(graph.inputs, {"P": system.potential}).nodes)


@mark.parametrize("make", [lambda: random_arm(4, damped=False), cart_pendulum], ids=["arm", "cart"])
def test_the_torque_is_the_sum_of_those_of_the_partial_lagrangians(make) -> None:
    system = as_system(make())
    state = states(system, STATES)
    graph = system.graph({str(i): part for i, part in enumerate(system.partial_lagrangians)}, system.q, system.qd)

    def alone(i: int) -> System:
        return System(lambda q, qd, t: graph(*q, *qd)[str(i)], system.coordinates)

    total = sum(run(dyn.inverse_dynamics(alone(i)), state) for i in range(len(system.partial_lagrangians)))
    assert len(system.partial_lagrangians) > 1
    assert error(run(dyn.inverse_dynamics(system), state), total) < ROUNDING
