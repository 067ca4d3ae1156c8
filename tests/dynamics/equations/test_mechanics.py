"""Truths of mechanics, for every model: no second implementation is needed."""

from typing import Any

import numpy as np
from pytest import approx, fixture, mark

import cgraph as cg
import dynamics as dyn
from dynamics import System, as_system
from tests import high_precision
from tests.dynamics.models import MODELS, Array, at, cart_pendulum, error, inputs, random_arm, run, states

STATES = 50
ROUNDING = 1e-12  # sums of terms that may cancel tenfold
ILL_CONDITIONED = 1e-10  # the same through M and M^-1, whose condition number reaches 3e3 with six links
QUADRATIC = [name for name in MODELS if name not in ("driven pendulum", "magnetic", "relativistic")]


@fixture(params=MODELS)
def known(request) -> tuple[System, dict[str, Any]]:
    system = as_system(MODELS[request.param]())
    return system, states(system, STATES)


def matrices(system: System, state: dict[str, Any]) -> Array:
    return run(dyn.mass_matrix(system), state).reshape(-1, system.n, system.n)


def times(matrix: Array, vector: Array) -> Array:
    return (matrix @ vector[..., None])[..., 0]


def applied(system: System, state: dict[str, Any]) -> Array:
    """forces - damping qd."""
    forces = system.graph({f"f{i}": force for i, force in enumerate(system.forces)}, system.q, system.qd)
    return run(forces, state) - np.array(system.damping) * state["qd"]


def test_the_mass_matrix_is_symmetric_and_positive_definite(known) -> None:
    matrix = matrices(*known)
    assert (matrix == matrix.swapaxes(1, 2)).all()
    assert np.linalg.eigvalsh(matrix).min() > 0.0


def test_torque_is_inertia_and_bias_and_what_is_applied(known) -> None:
    system, state = known
    expected = times(matrices(system, state), state["qdd"]) + run(dyn.bias(system), state) - applied(system, state)
    assert error(run(dyn.inverse_dynamics(system), state), expected) < ROUNDING


def test_inverse_undoes_forward(known) -> None:
    system, state = known
    qdd = run(dyn.forward_dynamics(system), state)
    assert error(run(dyn.inverse_dynamics(system), {**state, "qdd": qdd}), state["tau"]) < ILL_CONDITIONED


def test_power_balance(known) -> None:
    """dE/dt = (tau + forces - damping qd) . qd - dL/dt, E's rate by differences at 80 digits along the motion."""
    system, many = known
    energy = dyn.energy(system)
    lagrangian = system.graph({"L": system.lagrangian}, system.q, system.qd)
    qdd, forces = run(dyn.forward_dynamics(system), many), applied(system, many)
    for row in range(5):
        state = at(many, row)
        along = {f"q{i}": v for i, v in enumerate(state["qd"])} | {f"qd{i}": a for i, a in enumerate(qdd[row])}
        rate = high_precision.directional(energy, inputs(energy, state), along | {"t": 1.0})["E"]
        explicit = high_precision.directional(lagrangian, inputs(lagrangian, state), {"t": 1.0})["L"]
        work = (state["tau"] + forces[row]) * state["qd"]
        scale = np.abs(np.concatenate([work, run(dyn.bias(system), state) * state["qd"]])).max()
        assert float(rate) == approx(work.sum() - float(explicit), rel=0.0, abs=ILL_CONDITIONED * scale)


@mark.parametrize("name", QUADRATIC)
def test_momentum_is_mass_matrix_times_velocity(name: str) -> None:
    system = as_system(MODELS[name]())
    state = states(system, STATES)
    assert error(run(dyn.momentum(system), state), times(matrices(system, state), state["qd"])) < ROUNDING


def test_kinetic_minus_potential_is_the_lagrangian(known) -> None:
    system, state = known
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


def test_a_link_s_lagrangian_moves_no_joint_beyond_it() -> None:
    system = as_system(random_arm(4))
    for i, part in enumerate(system.partial_lagrangians):
        used = {node.name for node in cg.Graph([*system.q, *system.qd], {"L": part}).nodes if node.name}
        assert used == {f"{x}{j}" for x in ("q", "qd") for j in range(i + 1)}
