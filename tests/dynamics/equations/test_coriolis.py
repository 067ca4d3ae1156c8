"""The Coriolis matrix: closed form, Christoffel's symbols from differences of M, and what holds of every one."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from dynamics import as_system, coriolis, damping_force
from dynamics.equations.states.evaluate import evaluate
from tests.dynamics.mechanisms import EVERY_FAMILY, FAMILIES
from tests.dynamics.models import MODELS, Array, magnetic, random_arm, relativistic, states

STEP = 1e-3  # of differences of fourth order: they are right to some 1e-11
DIFFERENCES = 1e-9  # of the largest entry: their rounding, magnified by 1 / STEP
ROUNDING = 1e-12  # of the largest entry

MECHANISMS = {name: lambda make=make: make(5) for name, make in FAMILIES.items()}
SCLERONOMIC = {name: MODELS[name] for name in ("arm of 1", "arm of 3", "coupled springs", "cart pendulum", "magnetic")}


def matrix(graph: cg.Graph, model: object, **state: Array) -> Array:
    n = as_system(model).n
    return evaluate(model, graph, state).reshape(-1, n, n)


@pytest.mark.parametrize("name", EVERY_FAMILY)
def test_its_entries_are_christoffel_s_symbols_times_the_velocities(name: str) -> None:
    mechanism, mass = MECHANISMS[name](), dyn.mass_matrix(MECHANISMS[name]())
    given, n = states(mechanism, 3, 1), mechanism.system.n
    q, qd = given["q"], given["qd"]

    def slope(k: int) -> Array:
        at = {s: matrix(mass, mechanism, q=q + s * STEP * np.eye(n)[k], qd=qd) for s in (-2, -1, 1, 2)}
        return (8 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12 * STEP)

    slopes = np.stack([slope(k) for k in range(n)], axis=-1)  # dM_ij/dq_k
    symbols = 0.5 * (slopes + np.swapaxes(slopes, 2, 3) - np.moveaxis(slopes, 3, 1))  # i, j, k
    expected = np.einsum("sijk,sk->sij", symbols, qd)
    assert matrix(coriolis(mechanism), mechanism, q=q, qd=qd) == approx(expected, abs=DIFFERENCES * abs(expected).max())


@pytest.mark.parametrize("name", [*MECHANISMS, *SCLERONOMIC])
def test_it_gives_the_bias_and_leaves_a_skew_matrix(name: str) -> None:
    model = (MECHANISMS | SCLERONOMIC)[name]()
    system, given = as_system(model), states(model, 10)
    q, qd = given["q"], given["qd"]
    found = matrix(coriolis(model), model, q=q, qd=qd)
    bias, gravity = (evaluate(system, graph, given) for graph in (dyn.bias(model), dyn.gravity_force(model)))
    assert np.einsum("sij,sj->si", found, qd) + gravity == approx(bias, abs=ROUNDING * abs(bias).max())
    along = cg.jvp(dyn.mass_matrix(model), system.q)
    values = {f"q{i}": q[:, i] for i in range(system.n)} | {f"q{i}_dot": qd[:, i] for i in range(system.n)}
    values |= {f"qd{i}": qd[:, i] for i in range(system.n)} | system.parameters | {"t": 0.0}
    change = np.stack(list(along.evaluate({name: values[name] for name in along.input_names}).values()), axis=-1)
    skew = change.reshape(found.shape) - 2 * found
    assert skew + np.swapaxes(skew, 1, 2) == approx(0 * skew, abs=ROUNDING * max(1.0, abs(found).max()))


def test_forces_linear_in_velocity_count_in_full() -> None:
    """A charge in a magnetic field B: the force is B (-y', x'), all of it in C."""
    model = magnetic()
    found = matrix(coriolis(model), model, q=np.ones(2), qd=np.ones(2))[0]
    assert found == approx(np.array([[0.0, -2.0], [2.0, 0.0]]))


def test_a_lagrangian_that_is_not_quadratic_is_refused() -> None:
    with pytest.raises(ValueError, match=r"quadratic in the velocities, its mass matrix .* of '\w+' \(qd0\)"):
        coriolis(relativistic())


def test_damping_takes_its_coefficient_times_the_velocity() -> None:
    arm = random_arm(3)
    graph = damping_force(arm)
    qd = np.array([1.0, -2.0, 3.0])
    assert evaluate(arm.system, graph, {"qd": qd, "q": qd}) == approx(np.array(arm.system.damping) * qd)
    assert {tag for node in graph.nodes for tag in node.tags} == {"damping"}


def test_dampers_between_coordinates_are_the_force_of_their_matrix() -> None:
    """By every equation with damping in it, and a linear motion as the exponential has it."""
    c, rng = cg.variable("c"), np.random.default_rng(0)
    rows = [[c + 0.3, -c], [0.2 - c, c]]

    def blocks(**given: Any) -> dyn.System:
        return dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2 - q[0] ** 2), "x y", {"c": 0.5}, **given)

    damped, pushed = blocks(damping=rows), blocks(forces=lambda q, qd, t: -np.array(rows) @ qd)
    equations = [dyn.forward_dynamics, dyn.hamilton_equations, dyn.state_space, dyn.inverse_dynamics_derivatives]
    equations += [partial(dyn.inverse_dynamics, formulation=name) for name in dyn.FORMULATIONS]
    for each in equations:
        ours, theirs = each(damped), each(pushed)
        point = dict(zip(ours.input_names, rng.normal(size=len(ours.inputs)), strict=True))
        assert ours.evaluate(point) == approx(theirs.evaluate(point), rel=1e-12, abs=1e-15)
    values, vectors = np.linalg.eig([[0, 0, 1, 0], [0, 0, 0, 1], [-1, 0, -0.8, 0.5], [0, 0, 0.3, -0.5]])
    exact = vectors @ (np.exp(2.0 * values) * np.linalg.solve(vectors, [1.0, 0.0, 0.0, 0.5]))
    for options in ({"method": "dop853"}, {"method": "verlet", "dt": 1e-3, "form": "velocity"}):
        run = dyn.simulate(damped, [1.0, 0.0], [0.0, 0.5], 2.0, **options)
        assert [*run.q[-1], *run.qd[-1]] == approx(exact.real, rel=1e-6)
