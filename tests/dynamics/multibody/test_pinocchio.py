"""Planar arms against Pinocchio, whose inertias may be zero: a second peer that shares nothing with MuJoCo."""

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.models import at, error, random_arm, states

pinocchio = pytest.importorskip("pinocchio", reason="the bench extra has it")
from tests.dynamics.pinocchio_twin import pinocchio_model  # noqa: E402 (skipped above where it cannot be had)

STATES = 100
AGREEMENT = 1e-11  # of the largest entry: float64 rounding times a condition number of M up to 3e4 at ten links


@mark.parametrize("model", ["rod", "point"])
@mark.parametrize("n", range(1, 11))
def test_torques_accelerations_mass_matrix_and_bias_agree(n: int, model: str) -> None:
    arm = random_arm(n, seed=2, model=model)
    peer = pinocchio_model(arm)
    data = peer.createData()
    damping = np.array(arm.system.damping)
    inverse, forward, inertia, bias = (
        cg.compile(make(arm)) for make in (dyn.inverse_dynamics, dyn.forward_dynamics, dyn.mass_matrix, dyn.bias)
    )
    for row in range(STATES):
        state = at(states(arm, STATES, seed=2), row)
        q, qd, qdd, tau = (state[name] for name in ("q", "qd", "qdd", "tau"))
        torque = pinocchio.rnea(peer, data, q, qd, qdd) + damping * qd
        assert error(inverse([*q, *qd, *qdd]), torque) < AGREEMENT
        assert error(forward([*q, *qd, *tau]), pinocchio.aba(peer, data, q, qd, tau - damping * qd)) < AGREEMENT
        assert error(inertia([*q, *qd]), pinocchio.crba(peer, data, q).ravel()) < AGREEMENT
        assert error(bias([*q, *qd]), pinocchio.nonLinearEffects(peer, data, q, qd)) < AGREEMENT
