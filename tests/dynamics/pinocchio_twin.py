"""Pinocchio twins: the same planar arm or mechanism as a Pinocchio model, for the tests and the benchmark."""

from typing import Any

import numpy as np
import pinocchio

import dynamics as dyn
from dynamics.multibody.builders.planar_arm import planar_links
from dynamics.multibody.trees.mechanism import WORLD

Array = np.ndarray[Any, np.dtype[np.float64]]


def pinocchio_model(arm: dyn.Mechanism) -> Any:
    """The arm joint by joint: hinges about -y, links along -z, so that a positive angle swings it towards +x."""
    model = pinocchio.Model()
    model.gravity.linear = np.array(arm.gravity)
    joint, drop = 0, 0.0
    for i, link in enumerate(planar_links(arm)):
        axis = pinocchio.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
        joint = model.addJoint(joint, axis, pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, -drop])), f"joint {i + 1}")
        body = pinocchio.Inertia(link.mass, np.array([0.0, 0.0, -link.center]), link.inertia * np.eye(3))
        model.appendBodyToJoint(joint, body, pinocchio.SE3.Identity())
        drop = link.length
    return model


class PinocchioTwin:
    """A mechanism body by body in Pinocchio, which merges welds itself; arrays are in the mechanism's coordinates.

    Pinocchio numbers joints depth first. Springs and damping are added here, as it has none of the one and applies the
    other in some versions only.
    """

    def __init__(self, mechanism: dyn.Mechanism) -> None:
        self.model = pinocchio.Model()
        self.model.gravity.linear = np.asarray(mechanism.gravity, dtype=np.float64)
        self.joints = {}
        ends = {WORLD: (0, pinocchio.SE3.Identity())}  # of each body: the joint that carries it, and where
        stack = [body for body in mechanism.bodies if body.parent == WORLD]
        while stack:
            body = stack.pop()
            self._hang(body, ends)
            stack += [child for child in mechanism.bodies if child.parent == body.name]
        self.data = self.model.createData()
        moving = [body for body in mechanism.bodies if body.joint.kind != "fixed"]
        names = [body.name for body in mechanism.moving]
        assert sorted(body.name for body in moving) == sorted(names)
        self.order = np.array([self.model.joints[self.joints[name]].idx_v for name in names])
        of = {body.name: body.joint for body in moving}
        joints = [of[name] for name in names]
        self.damping, self.stiffness, self.spring_reference, armature = np.array(
            [[joint.damping, joint.stiffness, joint.spring_reference, joint.armature] for joint in joints]
        ).T
        self.model.armature = self._theirs(armature)

    def _hang(self, body: dyn.Body, ends: dict[str, tuple[int, Any]]) -> None:
        parent, place = ends[body.parent]
        frame = pinocchio.SE3(np.asarray(body.joint.orientation), np.asarray(body.joint.position))
        joint, at = parent, place * frame
        if body.joint.kind != "fixed":
            axis = np.asarray(body.joint.axis) / np.linalg.norm(body.joint.axis)
            kinds = {
                "revolute": pinocchio.JointModelRevoluteUnaligned,
                "prismatic": pinocchio.JointModelPrismaticUnaligned,
                "screw": lambda axis: pinocchio.JointModelHelicalUnaligned(axis, body.joint.pitch),
            }
            joint = self.model.addJoint(parent, kinds[body.joint.kind](axis), at, body.name)
            self.joints[body.name], at = joint, pinocchio.SE3.Identity()
        ends[body.name] = (joint, at)
        given = np.asarray(body.inertia)
        inertia = pinocchio.Inertia(body.mass, np.asarray(body.center), np.diag(given) if given.ndim == 1 else given)
        self.model.appendBodyToJoint(joint, inertia, at)

    def _theirs(self, ours: Array) -> Array:
        result = np.empty_like(ours)
        result[self.order] = ours
        return result

    def _passive(self, q: Array, qd: Array) -> Array:
        return self.damping * qd + self.stiffness * (q - self.spring_reference)

    def rnea(self, q: Array, qd: Array, qdd: Array) -> Array:
        """tau, (n,), of a motion."""
        tau = pinocchio.rnea(self.model, self.data, *map(self._theirs, (q, qd, qdd)))
        return tau[self.order] + self._passive(q, qd)

    def aba(self, q: Array, qd: Array, tau: Array) -> Array:
        """qdd, (n,), of applied forces."""
        applied = tau - self._passive(q, qd)
        return pinocchio.aba(self.model, self.data, *map(self._theirs, (q, qd, applied)))[self.order]

    def crba(self, q: Array) -> Array:
        """M(q), (n, n)."""
        upper = np.triu(pinocchio.crba(self.model, self.data, self._theirs(q)))
        return (upper + np.triu(upper, 1).T)[np.ix_(self.order, self.order)]
