"""Planar arms against Pinocchio, whose inertias may be zero: a second peer that shares nothing with MuJoCo."""

from typing import Any

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.models import at, error, random_arm, states

pinocchio = pytest.importorskip("pinocchio", reason="the bench extra has it")

STATES = 100
AGREEMENT = 1e-11  # of the largest entry: float64 rounding times a condition number of M up to 3e4 at ten links


def pinocchio_model(arm: dyn.PlanarArm) -> Any:
    """The arm joint by joint: hinges about -y, links along -z, so that a positive angle swings it towards +x."""
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, 0.0, -arm.gravity])
    joint, drop = 0, 0.0
    for i, link in enumerate(arm.links):
        axis = pinocchio.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
        joint = model.addJoint(joint, axis, pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -drop])), f"joint {i + 1}")
        body = pinocchio.Inertia(link.mass, np.array([0.0, 0.0, -link.center]), link.inertia * np.eye(3))
        model.appendBodyToJoint(joint, body, pinocchio.SE3.Identity())
        drop = link.length
    return model


@mark.parametrize("model", ["rod", "point"])
@mark.parametrize("n", range(1, 11))
def test_torques_accelerations_mass_matrix_and_bias_agree(n: int, model: str) -> None:
    arm = random_arm(n, seed=2, model=model)
    peer = pinocchio_model(arm)
    data = peer.createData()
    damping = np.array(arm.damping)
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
