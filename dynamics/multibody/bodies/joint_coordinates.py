"""The coordinates and velocities of the joints of a tree of bodies, one joint after another."""

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array

from ...systems.kinematics import QuasiVelocities
from ..joints import JointType
from ..parameters import Quantities
from .body import NO_LIMITS, WORLD, Body, Limits

Value = TypeVar("Value")
_FORCES = {"rad/s": "N m", "m/s": "N"}


class Places(NamedTuple):
    """Places of a joint's coordinates and velocities among all."""

    q: slice
    u: slice


def places(bodies: Sequence[Body]) -> list[Places]:
    """Places of the coordinates and velocities of the joints of moving bodies."""
    result, q, u = [], 0, 0
    for body in bodies:
        kind = body.joint.type
        q_end, u_end = q + len(kind.coordinates), u + len(kind.velocities)
        result.append(Places(slice(q, q_end), slice(u, u_end)))
        q, u = q_end, u_end
    return result


def coordinate_names(bodies: Sequence[Body]) -> tuple[str, ...]:
    """Names of all coordinates: the joint's, with a word for the coordinate where it has several."""
    return tuple([_called(body, name) for body in bodies for name in body.joint.type.coordinates])


def velocity_names(bodies: Sequence[Body]) -> tuple[str, ...]:
    """Names of all velocities: the joint's, with a word for the velocity where it has several."""
    return tuple([_called(body, name) for body in bodies for name in body.joint.type.velocities])


def joint_limits(bodies: Sequence[Body]) -> dict[str, Limits]:
    """{coordinate: its limits}, those of its joint."""
    limits = [body.joint.limits or NO_LIMITS for body in bodies for _ in body.joint.type.coordinates]
    return dict(zip(coordinate_names(bodies), limits, strict=True))


def _called(body: Body, name: str) -> str:
    return f"{body.coordinate}.{name}" if name else body.coordinate


def per_velocity(bodies: Sequence[Body], values: Sequence[Value]) -> list[Value]:
    """A value of each joint for each of its velocities."""
    return [value for body, value in zip(bodies, values, strict=True) for _ in body.joint.type.velocities]


def lengths(bodies: Sequence[Body]) -> tuple[float, ...]:
    """Length [m] that 1 of each coordinate stands for, then 1 of each velocity in a second; 0 where none is known.

    1 of slides. An angle is as large as the way of a point that it moves by the largest length of the bodies, of
    numbers: where their joints are on one another, where their mass is, and over which it is spread.
    """
    known = [float(np.linalg.norm(_numbers(body.joint.position))) for body in bodies if body.parent != WORLD]
    known += [float(np.linalg.norm(_numbers(body.center))) for body in bodies]
    known += [math.sqrt(float(np.abs(_numbers(body.inertia)).max()) / float(body.mass)) for body in bodies if body.mass]
    of = {"rad": max(known, default=0.0)}
    types = [body.joint.type for body in bodies]
    units = [unit for part in ("units", "velocity_units") for kind in types for unit in getattr(kind, part)]
    return tuple([of.get(unit.removesuffix("/s"), 1.0) for unit in units])


def _numbers(values: Quantities) -> Array:
    return np.asarray(values, dtype=np.float64)


def neutral(bodies: Sequence[Body]) -> list[float]:
    """The neutral coordinates of all joints."""
    return [value for body in bodies for value in body.joint.type.neutral]


def display_units(bodies: Sequence[Body]) -> dict[str, str]:
    """{name in a graph: unit} of moving bodies: "1" of the entries of a quaternion, "N m" of a torque."""
    units: dict[str, str] = {}
    types = [body.joint.type for body in bodies]
    for i, unit in enumerate([each for kind in types for each in kind.units]):
        rate = "1/s" if unit == "1" else f"{unit}/s"
        units |= {f"q{i}": unit, f"q{i}_old": unit, f"q{i}_dot": rate}
    for i, unit in enumerate([each for kind in types for each in kind.velocity_units]):
        acceleration, force = unit.replace("/s", "/s\u00b2"), _FORCES[unit]
        units |= {f"qd{i}": unit, f"qd{i}_old": unit, f"qd{i}_dot": acceleration, f"qdd{i}": acceleration}
        units |= {f"{kind}{i}": force for kind in ("tau", "bias", "gravity")}
        units |= {f"p{i}": f"{force} s", f"p{i}_dot": force}
    return units


def _are_rates(kind: JointType) -> bool:
    """Whether the velocities of a joint are the rates of its coordinates."""
    q = cg.variables([f"q{k}" for k in range(len(kind.coordinates))])
    u = cg.variables([f"qd{k}" for k in range(len(kind.velocities))])
    return list(kind.rate(q, u)) == u


def quasi_velocities(bodies: Sequence[Body]) -> QuasiVelocities | None:
    """Map from the joints' velocities to rates of coordinates; None where it is the identity."""
    types = [body.joint.type for body in bodies]
    if all([_are_rates(kind) for kind in {*types}]):
        return None
    groups = [place.q.start + group for kind, place in zip(types, places(bodies), strict=True) for group in kind.groups]
    rate, structure, normalized = (
        partial(_of_joints, bodies, *each) for each in (("rate", "qu"), ("structure", "uu"), ("normalized", "q"))
    )
    return QuasiVelocities(velocity_names(bodies), rate, structure, neutral(bodies), normalized, groups)


def _of_joints(bodies: Sequence[Body], what: str, kinds: str, *values: Sequence[Node]) -> list[Node]:
    """What a function of the joint's type makes of its part of each of the values, of coordinates q or velocities u."""
    result: list[Node] = []
    for body, place in zip(bodies, places(bodies), strict=True):
        own = [all_of[getattr(place, kind)] for all_of, kind in zip(values, kinds, strict=True)]
        result += getattr(body.joint.type, what)(*own)
    return result
