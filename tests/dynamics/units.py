"""Mechanisms in other units of mass, length and time."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import dynamics as dyn
from tests.dynamics.mechanisms import Array

LIMITS = {"mass": 12.0, "length": 9.0, "time": 6.0}  # decades of the factors, each way


class Units(NamedTuple):
    mass: float = 1.0
    length: float = 1.0
    time: float = 1.0

    @property
    def energy(self) -> float:
        return self.mass * self.length * self.length / self.time / self.time

    def of(self, mechanism: dyn.Mechanism) -> Array:
        return np.array([1.0 if body.joint.type.turns else self.length for body in mechanism.moving])


def random_units(rng: np.random.Generator, *, binary: bool) -> Units:
    decades = [rng.uniform(-limit, limit) for limit in LIMITS.values()]
    return Units(*[2.0 ** round(each / math.log10(2.0)) if binary else float(f"{10.0**each:.3g}") for each in decades])


def in_units(mechanism: dyn.Mechanism, units: Units) -> dyn.Mechanism:
    m, length, t = units
    bodies = []
    for body in mechanism.bodies:
        joint, u = body.joint, 1.0 if body.joint.type.turns else length
        joint = replace(
            joint,
            position=length * np.asarray(joint.position),
            damping=joint.damping * (units.energy * t / u / u),
            stiffness=joint.stiffness * (units.energy / u / u),
            spring_reference=joint.spring_reference * u,
            pitch=length * joint.pitch,
            armature=joint.armature * (m * length * length / u / u),
        )
        center, inertia = length * np.asarray(body.center), m * length * length * np.asarray(body.inertia)
        bodies.append(replace(body, joint=joint, mass=m * body.mass, center=center, inertia=inertia))
    return dyn.Mechanism(bodies, length / t / t * np.asarray(mechanism.gravity))
