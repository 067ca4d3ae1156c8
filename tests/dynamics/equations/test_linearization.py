"""Linearization against differences of other programs' accelerations, Pinocchio's derivatives, and closed forms."""

from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from cgraph.autodiff.sparsity import written_sizes
from dynamics import as_system, linearize, state_space
from dynamics.equations.linearization import linearization
from dynamics.equations.states.evaluate import evaluate
from tests.dynamics.equations.test_hamiltonian import rotor
from tests.dynamics.mechanisms import random_mechanism, turned_arm
from tests.dynamics.models import MODELS, Array, at, random_arm, states

STEP = 1e-3  # of the differences, in units of the state
DIFFERENCES = 1e-7  # fourth order at that step, of what M^-1 magnifies
ONE_BY_ONE = 1e-9  # arrays and floats: sine and cosine of NumPy and of the C library, magnified by M^-1


def differences(rate: object, x: Array) -> Array:
    """The Jacobian of rate(x) by central differences of fourth order."""
    columns = []
    for unit in np.eye(len(x)):
        v = {s: rate(x + s * STEP * unit) for s in (-2, -1, 1, 2)}  # type: ignore[operator]
        columns.append((8 * (v[1] - v[-1]) - (v[2] - v[-2])) / (12 * STEP))
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", MODELS)
def test_it_is_the_slope_of_forward_dynamics(name: str) -> None:
    model = MODELS[name]()
    system, state = as_system(model), at(states(model, 1), 0)
    n, t, accelerations = system.n, 0.3, dyn.forward_dynamics(model)

    def rate(x: Array) -> Array:
        qdd = evaluate(system, accelerations, {"q": x[:n], "qd": x[n : 2 * n], "tau": x[2 * n :]}, t)
        return np.concatenate([x[n : 2 * n], qdd])

    expected = differences(rate, np.concatenate([state["q"], state["qd"], state["tau"]]))
    found = np.hstack(linearize(model, state["q"], state["qd"], state["tau"], t=t))
    assert found == approx(expected, abs=DIFFERENCES * abs(expected).max())


def test_the_graph_takes_many_states_and_is_smaller_than_that_of_forward_dynamics_differentiated() -> None:
    arm = turned_arm(5)
    graph = state_space(arm)
    assert len(graph.nodes) < 4_200  # 8 300 of the Jacobian of forward dynamics
    assert len(state_space(arm, form="momentum").nodes) < 0.75 * len(graph.nodes)
    given = states(arm, 3)
    rows = evaluate(arm.system, graph, given)
    one = np.concatenate([each.ravel() for each in linearize(arm, *(given[name][1] for name in ("q", "qd", "tau")))])
    assert rows[1] == approx(one, rel=ONE_BY_ONE, abs=ONE_BY_ONE)


FEW = {
    "planar": lambda: random_arm(2),
    "ball": lambda: random_mechanism(1, ["ball"], 1),
    "driven": MODELS["driven pendulum"],
    "undamped": lambda: random_arm(3, damped=False),
    "rotor": rotor,
}


@pytest.mark.parametrize("way", ["written out", "sums of rows", "slopes"])
@pytest.mark.parametrize(
    ("name", "form"),
    [(name, "velocity") for name in FEW if name != "rotor"] + [(name, "momentum") for name in FEW if name != "ball"],
)
def test_many_states_are_linearized_as_one(name: str, form: Any, way: str) -> None:
    """B, and J A where nothing brakes, is symmetric to the last bit."""
    written, path = linearization.WRITTEN_OUT if way == "written out" else 0, 0 if way == "slopes" else 32
    with patch.multiple(linearization, WRITTEN_OUT=written, LONG_PATH=path):
        require_alike(FEW[name](), form, symmetric=name == "undamped")


def test_sums_of_rows_are_chosen_by_counts_and_do_less_for_every_vector_of_directions() -> None:
    arm, rod = turned_arm(12), dyn.planar_arm([1.0] * 33, [0.3] * 33)
    rows, sweep = linearization.linear_rows(arm.system, "velocity"), cg.vjp(dyn.forward_dynamics(arm))
    assert rows.turned
    assert not linearization.linear_rows(rod.system, "velocity").turned
    assert written_sizes(rows.graph, rows.wrt)[0] < 0.5 * written_sizes(sweep, sweep.inputs[-12:])[0]  # 2284, 4897


def require_alike(model: Any, form: Any, *, symmetric: bool) -> None:
    rng, count, system = np.random.default_rng(0), 131, as_system(model)
    q = np.array(system.kinematics.neutral) + rng.uniform(-1.0, 1.0, (count, system.nq))
    qd, tau = rng.normal(size=(count, system.n)), rng.normal(size=system.n)
    a, b = dyn.linearize_many(model, q, qd, tau, t=0.3, form=form)
    again = dyn.linearize_many(model, q, qd, tau, t=0.3, form=form, threads=2)
    assert all(map(np.array_equal, (a, b), again))
    assert {8} <= {*a.strides[1:]} & {*b.strides[1:]}  # row by row or column by column, as linear algebra takes them
    for k in (0, count - 1):
        for found, expected in zip((a[k], b[k]), linearize(model, q[k], qd[k], tau, t=0.3, form=form), strict=True):
            assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
        if symmetric:
            n = system.n
            forces, matrix = b[k, n:], np.vstack([a[k, n:], -a[k, :n]])
            assert np.array_equal(forces, forces.T)
            assert form == "velocity" or np.array_equal(matrix, matrix.T)


def test_of_no_states_there_are_no_matrices_and_one_state_is_refused() -> None:
    a, b = dyn.linearize_many(random_arm(2), np.zeros((0, 2)), np.zeros((0, 2)))
    assert a.shape == (0, 4, 4)
    assert b.shape == (0, 4, 2)
    with pytest.raises(ValueError, match="rows of states"):
        dyn.linearize_many(random_arm(2), np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="as many rows, or one, got 2 of qd after 3"):
        dyn.linearize_many(random_arm(2), np.zeros((3, 2)), np.zeros((2, 2)))


def bead(q, qd, t):  # type: ignore[no-untyped-def]
    """Without inertia at 0."""
    return 0.5 * q[0] ** 2 * qd[0] ** 2 - q[0]


REFUSED = {
    "several": (random_arm(2), [[0.0, 0.0]], [[0.0, 0.0]], {}, "one state, got rows of several"),
    "a time": (random_arm(2), [0.0, 0.0], [0.0, 0.0], {"t": np.nan}, "t must be finite, got nan"),
    "no turn": (random_mechanism(1, ["ball"], 1), [0.0] * 4, [0.0] * 3, {}, "need a length whose square"),
    "no inertia": (dyn.System(bead, ["x"]), [0.0], [0.0], {}, "coordinate 'x' has an inertia that is not positive"),
    "too large": (random_arm(2), [1.0, 1.0], [1e200, 0.0], {}, "leave the range of float64"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_state_that_cannot_be_linearized_is_refused(name: str) -> None:
    model, q, qd, others, message = REFUSED[name]
    with pytest.raises(ValueError, match=message):
        linearize(model, q, qd, **others)  # type: ignore[arg-type]
