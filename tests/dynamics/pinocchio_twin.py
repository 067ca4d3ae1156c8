"""Pinocchio twins: the same planar arm as a Pinocchio model, for the tests and the benchmark."""

from typing import Any

import numpy as np
import pinocchio

import dynamics as dyn


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
