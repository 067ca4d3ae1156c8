"""Truths of mechanics, for every model: no second implementation is needed."""

from pytest import approx, mark

import cgraph as cg
from dynamics import as_system
from tests.dynamics.models import MODELS, run, states

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
