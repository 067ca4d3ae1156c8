"""Truths of mechanics, for every model: no second implementation is needed."""

from typing import Any

import numpy as np
from pytest import approx, fixture, mark

import cgraph as cg
import dynamics as dyn
from dynamics import System, as_system
from dynamics.multibody.builders.planar_arm import planar_links
from tests import high_precision
from tests.dynamics.models import MODELS, Array, at, cart_pendulum, error, inputs, random_arm, run, states

STATES = 50
ROUNDING = 1e-12  # sums of terms that may cancel tenfold
LARGEST = 100.0  # N m, torques of random arms
LEFT = 1e-11  # what is left of ROUNDING when a term ten times as large is taken away
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


@mark.parametrize("name", QUADRATIC)
def test_energy_is_half_of_momentum_times_velocity_and_the_potential(name: str) -> None:
    system = as_system(MODELS[name]())
    state = states(system, STATES)
    kinetic = 0.5 * (run(dyn.momentum(system), state) * state["qd"]).sum(axis=1)
    potential = run(system.graph({"P": system.potential}, system.q, system.qd), state)[:, 0]
    assert run(dyn.energy(system), state)[:, 0] == approx(kinetic + potential, rel=ROUNDING, abs=ROUNDING)


def test_kinetic_minus_potential_is_the_lagrangian(known) -> None:
    system, state = known
    graph = system.graph({"K": system.kinetic, "P": system.potential, "L": system.lagrangian}, system.q, system.qd)
    kinetic, potential, lagrangian = run(graph, state).T
    assert kinetic - potential == approx(lagrangian, rel=ROUNDING, abs=ROUNDING)
    assert not set(system.qd) & set(cg.Graph(graph.inputs, {"P": system.potential}).nodes)


@mark.parametrize("name", [name for name in QUADRATIC if name != "coupled springs"])
def test_the_kinetic_energy_vanishes_at_rest(name: str) -> None:
    system = as_system(MODELS[name]())
    rest = {**states(system, STATES), "qd": np.zeros((STATES, system.n))}
    assert (run(system.graph({"K": system.kinetic}, system.q, system.qd), rest) == 0.0).all()


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


@mark.parametrize("n", [2, 5])
def test_the_bias_of_an_arm_is_quadratic_in_velocity_beside_gravity(n: int) -> None:
    arm = random_arm(n)
    state = states(arm, STATES)
    bias, gravity = dyn.bias(arm), run(dyn.gravity_force(arm), state)
    once, twice = (run(bias, {**state, "qd": factor * state["qd"]}) - gravity for factor in (1.0, 2.0))
    assert error(twice, 4.0 * once) < LEFT


@mark.parametrize("n", [2, 5])
def test_turning_the_whole_arm_changes_gravity_and_nothing_else(n: int) -> None:
    links = (np.linspace(1.0, 0.6, n).tolist(), np.linspace(0.7, 1.2, n).tolist())
    weightless = dyn.planar_arm(*links, gravity=0.0)
    state = states(weightless, STATES)
    turned = {**state, "q": state["q"] + np.eye(n)[0] * 1.1}
    for make in (dyn.inverse_dynamics, dyn.mass_matrix, dyn.bias, dyn.energy):
        assert run(make(weightless), turned) == approx(run(make(weightless), state), rel=LEFT, abs=LEFT)
    assert run(dyn.gravity_force(weightless), state) == approx(0.0, abs=0.0)
    assert error(run(dyn.bias(dyn.planar_arm(*links)), turned), run(dyn.bias(dyn.planar_arm(*links)), state)) > 0.1


@mark.parametrize("n", [1, 3])
def test_damping_adds_its_coefficient_times_velocity_to_the_torque(n: int) -> None:
    damped, plain = random_arm(n), random_arm(n, damped=False)
    assert planar_links(damped) == planar_links(plain)
    state = states(damped, STATES)
    more = run(dyn.inverse_dynamics(damped), state) - run(dyn.inverse_dynamics(plain), state)
    assert more == approx(np.array(damped.system.damping) * state["qd"], rel=0.0, abs=ROUNDING * LARGEST)
    for make in (dyn.bias, dyn.mass_matrix, dyn.energy, dyn.momentum):  # damping is in none of them
        assert (run(make(damped), state) == run(make(plain), state)).all()
