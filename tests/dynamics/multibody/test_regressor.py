"""The regressor against inverse dynamics, and against Pinocchio's."""

from __future__ import annotations

import numpy as np
import pytest
from pytest import approx

import dynamics as dyn
from dynamics.equations.states.evaluate import evaluate
from dynamics.multibody.quantities.regressor import inertial_parameters, regressor
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


def test_of_a_pendulum_it_is_the_textbook_s() -> None:
    """About -y, hanging down: tau = Iyy qdd + g (mx cos q - mz sin q), and nothing else counts."""
    arm = dyn.planar_arm([3.0], [2.0])
    q, qdd = 0.4, 1.7
    found = value(arm, {"q": np.array([q]), "qd": np.array([5.0]), "qdd": np.array([qdd])})[0, 0, 0]
    expected = {"mx": 9.81 * np.cos(q), "mz": -9.81 * np.sin(q), "Iyy": qdd}
    names = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
    assert found == approx(np.array([expected.get(name, 0.0) for name in names]))
    assert inertial_parameters(arm)[0] == approx(np.array([3, 0, 0, -3, 4, 0, 4, 0, 0, 0]))


@pytest.mark.parametrize("family", EVERY_FAMILY)
def test_it_is_pinocchio_s(family: str) -> None:
    pinocchio = pytest.importorskip("pinocchio", reason="the bench extra has it")
    from tests.dynamics.pinocchio_twin import PinocchioTwin

    mechanism = FAMILIES[family](6)
    twin, state, n = PinocchioTwin(mechanism), at(states(mechanism, 1, 3), 0), mechanism.system.n
    motion = [twin._theirs(state[name]) for name in ("q", "qd", "qdd")]
    joints = [twin.joints[name] for name in mechanism.system.coordinates]
    theirs = pinocchio.computeJointTorqueRegressor(twin.model, twin.data, *motion).reshape(n, n, 10)
    theirs = theirs[np.ix_(twin.order, [joint - 1 for joint in joints])]
    parameters = np.array([twin.model.inertias[joint].toDynamicParameters() for joint in joints])
    assert value(mechanism, state)[0] == approx(theirs, abs=ROUNDING * abs(theirs).max())
    assert inertial_parameters(mechanism) == approx(parameters, abs=ROUNDING)


@pytest.mark.parametrize("family", EVERY_FAMILY)
def test_pinocchio_s_coriolis_matrix_and_gravity_are_ours(family: str) -> None:
    """Its matrix is that of Christoffel's symbols too, entry by entry."""
    pinocchio = pytest.importorskip("pinocchio", reason="the bench extra has it")
    from dynamics.equations.coriolis import coriolis
    from tests.dynamics.pinocchio_twin import PinocchioTwin

    mechanism = FAMILIES[family](6)
    twin, state, n = PinocchioTwin(mechanism), at(states(mechanism, 1, 3), 0), mechanism.system.n
    q, qd = (twin._theirs(state[name]) for name in ("q", "qd"))
    matrix = pinocchio.computeCoriolisMatrix(twin.model, twin.data, q, qd)[np.ix_(twin.order, twin.order)]
    weight = pinocchio.computeGeneralizedGravity(twin.model, twin.data, q)[twin.order]
    weight = weight + twin.stiffness * (state["q"] - twin.spring_reference)
    found = evaluate(mechanism.system, coriolis(mechanism), state).reshape(n, n)
    assert found == approx(matrix, abs=ROUNDING * abs(matrix).max())
    gravity = evaluate(mechanism.system, dyn.gravity_force(mechanism), state)
    assert gravity == approx(weight, abs=ROUNDING * abs(weight).max())


def test_it_is_small_and_free_of_the_parameters() -> None:
    graph = regressor(turned_arm(7))
    assert graph.input_names == tuple(f"{kind}{i}" for kind in ("q", "qd", "qdd") for i in range(7))
    assert len(graph.nodes) <= 3200  # for 490 entries


def test_another_model_is_refused() -> None:
    with pytest.raises(dyn.MechanismError, match="a regressor takes rigid bodies, a Mechanism or a scene of one"):
        regressor(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]))
