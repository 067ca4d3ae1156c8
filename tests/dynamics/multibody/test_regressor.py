"""The regressor against inverse dynamics."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from dynamics import inertial_parameters, regressor
from dynamics.equations.states.evaluate import evaluate
from tests.dynamics.mechanisms import EVERY_FAMILY, FAMILIES, turned_arm
from tests.dynamics.models import Array, at, states

ROUNDING = 1e-12


def value(mechanism: dyn.Mechanism, state: dict[str, Array]) -> Array:
    n = mechanism.system.n
    return evaluate(mechanism.system, regressor(mechanism), state).reshape(-1, n, n, 10)


@pytest.mark.parametrize("family", EVERY_FAMILY)
def test_times_the_parameters_it_is_the_torque_of_the_bodies(family: str) -> None:
    mechanism = FAMILIES[family](6)
    given = states(mechanism, 20)
    joints = [body.joint for body in mechanism.moving]
    armature, damping, stiffness, rest = np.array(
        [(j.armature, j.damping, j.stiffness, j.spring_reference) for j in joints]
    ).T
    tau = evaluate(mechanism.system, dyn.inverse_dynamics(mechanism), given)
    tau = tau - armature * given["qdd"] - damping * given["qd"] - stiffness * (given["q"] - rest)
    found = np.einsum("sikp,kp->si", value(mechanism, given), inertial_parameters(mechanism))
    assert found == approx(tau, abs=ROUNDING * abs(tau).max())


def test_it_is_small_and_free_of_the_parameters() -> None:
    graph = regressor(turned_arm(7))
    assert graph.input_names == tuple(f"{kind}{i}" for kind in ("q", "qd", "qdd") for i in range(7))
    assert len(graph.nodes) <= 3200  # for 490 entries


def test_another_model_is_refused() -> None:
    with pytest.raises(dyn.MechanismError, match="a regressor takes rigid bodies, a Mechanism or a scene of one"):
        regressor(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]))


@pytest.mark.parametrize("family", EVERY_FAMILY)
def test_its_columns_are_the_slopes_of_torques_by_the_numbers_of_bodies(family: str) -> None:
    """Numbers as parameters: c = h / m, and J = I - (h h 1 - h h^T) / m about the center."""
    mechanism = FAMILIES[family](4)
    names, bodies = [], []
    for i, body in enumerate(mechanism.moving):
        own = [f"{name}{i}" for name in ("m", "x", "y", "z", "xx", "xy", "yy", "xz", "yz", "zz")]
        m, *h = cg.variables(own[:4])
        xx, xy, yy, xz, yz, zz = cg.variables(own[4:])
        square = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
        about = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        inertia = [[about[j][k] - (square * (j == k) - h[j] * h[k]) / m for k in range(3)] for j in range(3)]
        bodies.append(replace(body, mass=m, center=[each / m for each in h], inertia=inertia))
        names += own
    values = dict(zip(names, inertial_parameters(mechanism).ravel().tolist(), strict=True))
    named = dyn.Mechanism(bodies, mechanism.gravity, parameters=values)
    slopes, state = cg.jacobian(dyn.inverse_dynamics(named), names), at(states(mechanism, 1, 3), 0)
    point = values | {f"{kind}{i}": x for kind in ("q", "qd", "qdd") for i, x in enumerate(state[kind])}
    found = np.array([*slopes.evaluate({name: point[name] for name in slopes.input_names}).values()])
    expected = value(mechanism, state)[0].ravel()
    assert found == approx(expected, abs=10.0 * ROUNDING * abs(expected).max())


@pytest.mark.parametrize("family", EVERY_FAMILY)
def test_base_parameters_are_what_motion_shows(family: str) -> None:
    """Torques as those of all parameters, and as many as the rank, at other states."""
    mechanism = FAMILIES[family](4)
    base, width = dyn.base_parameters(mechanism), 10 * mechanism.system.n
    matrix = value(mechanism, states(mechanism, 60)).reshape(-1, width)
    own = matrix[:, base.columns]
    assert own @ base.grouping == approx(matrix, abs=ROUNDING * abs(matrix).max() * 10)
    assert base.grouping[:, base.columns].tolist() == np.eye(base.rank).tolist()
    lengths = np.linalg.norm(matrix, axis=0)
    assert base.rank == np.linalg.matrix_rank(matrix / np.where(lengths, lengths, 1.0), tol=1e-9)
    assert len(set(base.names)) == base.rank
