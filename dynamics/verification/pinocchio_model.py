"""Pinocchio's model of the bodies of a mechanism, and its states, forces and accelerations from ours and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from cgraph._shared import Array, required

from ..multibody.bodies.body import WORLD, Body
from ..multibody.bodies.joint_coordinates import places
from ..multibody.joints import AxialJoint, quaternion
from ..multibody.trees.mechanism import Mechanism
from .residual import UnavailableError

if TYPE_CHECKING:
    from pinocchio import Inertia, JointModel

# Pinocchio's joints for ours; of the first two it has quicker ones where the axis is one of the coordinate axes.
_JOINTS = {
    "revolute": "JointModelRevoluteUnaligned",
    "prismatic": "JointModelPrismaticUnaligned",
    "screw": "JointModelHelicalUnaligned",
    "ball": "JointModelSpherical",
    "free": "JointModelFreeFlyer",
    "free (body axes)": "JointModelFreeFlyer",
}
_ALIGNED = {"revolute": "JointModelR", "prismatic": "JointModelP"}
_WORLD_AXES = "free"  # whose linear velocity is in the axes of the joint, and Pinocchio's in the body's


def pinocchio() -> ModuleType:
    """The pinocchio module. Raises ImportError naming the extra when it is not installed."""
    return required("pinocchio", "Pinocchio is not installed", "pinocchio")


class PinocchioModel:
    """A mechanism in Pinocchio, without damping and springs.

    Its quaternions are (x, y, z, w), of length 1, and a free body's linear velocity is in the body's axes. Functions
    take one state, or many as columns. With R the axes of a free body, v = R v' and a = R (a' + omega x v').
    """

    def __init__(self, mechanism: Mechanism) -> None:
        module = pinocchio()
        self.model = module.Model()
        self.model.gravity.linear = np.asarray(mechanism.gravity, dtype=np.float64)
        ids, bodies = {WORLD: 0}, mechanism.moving
        where = {body.name: place for body, place in zip(bodies, places(bodies), strict=True)}
        self.q_order = np.empty(len(mechanism.coordinates), dtype=int)  # of each of our coordinates, the place in its q
        self.order = np.empty(len(mechanism.velocities), dtype=int)
        self._quaternions: list[slice] = []  # in Pinocchio's q
        self.turned: list[tuple[slice, slice, slice, float]] = []  # of free bodies: v', omega; quaternion; armature
        for body in _depth_first(bodies):
            frame = module.SE3(np.array(body.joint.orientation), np.array(body.joint.position))
            joint = self.model.addJoint(ids[body.parent], _joint(module, body), frame, body.coordinate)
            ids[body.name] = joint
            self.model.appendBodyToJoint(joint, _inertia(module, body), module.SE3.Identity())
            at, u = self.model.joints[joint].idx_q, self.model.joints[joint].idx_v
            end, last = u + len(body.joint.type.velocities), at + len(body.joint.type.coordinates)
            self.model.armature[u:end] = body.joint.armature
            self.order[where[body.name].u] = range(u, end)
            if last - at == 1:
                self.q_order[where[body.name].q] = at
                continue
            first = last - 4
            self.q_order[where[body.name].q] = [*range(at, first), first + 3, first, first + 1, first + 2]
            self._quaternions.append(slice(first, last))
            if body.joint.kind == _WORLD_AXES:
                self.turned.append((slice(u, u + 3), slice(u + 3, u + 6), slice(first, first + 4), body.joint.armature))
        self._q_at, self._at = np.argsort(self.q_order), np.argsort(self.order)

    def q(self, q: Array) -> Array:
        """Pinocchio's q of ours, (nq,) or (nq, k)."""
        result: Array = q[self._q_at].copy()
        for rows in self._quaternions:
            result[rows] /= np.linalg.norm(result[rows], axis=0)
        return result

    def v(self, q: Array, u: Array) -> Array:
        """Pinocchio's velocities, or forces, of ours; q: Pinocchio's."""
        result: Array = u[self._at].copy()
        for linear, _, rows, _ in self.turned:
            result[linear] = np.einsum("ji...,j...->i...", axes(q[rows]), result[linear])
        return result

    def a(self, q: Array, v: Array, a: Array) -> Array:
        """Pinocchio's accelerations of ours; q, v: Pinocchio's."""
        return self.v(q, a) - self.curved(v)

    def curved(self, v: Array) -> Array:
        """omega x v' of free bodies, and zeros."""
        result = np.zeros_like(v)
        for linear, angular, _, _ in self.turned:
            result[linear] = np.cross(v[angular], v[linear], axis=0)
        return result

    def rotor(self, v: Array) -> Array:
        """Force that Pinocchio lacks of the armature of free bodies, which moves along the axes of the joint."""
        result = self.curved(v)
        for linear, _, _, armature in self.turned:
            result[linear] *= armature
        return result

    def our_v(self, q: Array, v: Array) -> Array:
        """Our velocities, or forces, of Pinocchio's."""
        result = v.copy()
        for linear, _, rows, _ in self.turned:
            result[linear] = np.einsum("ij...,j...->i...", axes(q[rows]), v[linear])
        return result[self.order]

    def our_a(self, q: Array, v: Array, a: Array) -> Array:
        """Our accelerations of Pinocchio's."""
        return self.our_v(q, a + self.curved(v))


def _depth_first(bodies: Sequence[Body]) -> Iterator[Body]:
    """The bodies in the order that Pinocchio needs: what a body carries follows it without a gap."""
    stack = [body for body in reversed(bodies) if body.parent == WORLD]
    while stack:
        yield (body := stack.pop())
        stack += [each for each in reversed(bodies) if each.parent == body.name]


def _joint(module: ModuleType, body: Body) -> JointModel:
    """Pinocchio's joint. Raises UnavailableError for a kind that has none."""
    kind = body.joint.kind
    if kind not in _JOINTS:
        raise UnavailableError(f"has no joint of the kind {kind!r}")
    if not isinstance(body.joint.type, AxialJoint):
        return getattr(module, _JOINTS[kind])()
    axis = np.asarray(body.joint.axis)
    if kind not in _ALIGNED:
        return getattr(module, _JOINTS[kind])(axis, body.joint.pitch)
    for name, unit in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return getattr(module, _ALIGNED[kind] + name)()
    return getattr(module, _JOINTS[kind])(axis)


def _inertia(module: ModuleType, body: Body) -> Inertia:
    """Pinocchio's inertia. Raises UnavailableError for one that it does not take, as with a moment of -1e-20."""
    try:
        return module.Inertia(body.mass, np.array(body.center), np.array(body.inertia))
    except (RuntimeError, ValueError) as error:
        raise UnavailableError(f"does not take body {body.name!r}: {error}") from None


def axes(turn: Array) -> Array:
    """The axes, (3, 3) or (3, 3, k), of quaternions (x, y, z, w), (4,) or (4, k)."""
    return np.array(quaternion.rotation(cast(Any, np.roll(turn, 1, axis=0))))
