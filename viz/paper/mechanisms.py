"""Mechanisms of any size whose graphs are counted: planar chains, arms in space, trees."""

import math

import numpy as np

from cgraph._shared import Array
from dynamics import Body, Joint, Mechanism, planar_arm
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.bodies.body import WORLD


def chain(mass: float, length: float, n: int) -> Mechanism:
    """A planar chain of n equal rods with damping."""
    return planar_arm([mass] * n, [length] * n, damping=0.1)


def turned_arm(n: int) -> Mechanism:
    """A 3D arm of n revolute joints, full inertias, frames turned by quarter turns."""
    rng = np.random.default_rng(n)
    return Mechanism([turned_body(i, WORLD if i == 0 else f"link{i}", rng) for i in range(n)])


def binary_tree(n: int) -> Mechanism:
    """A tree of n revolute bodies, each with two children until there are n."""
    rng = np.random.default_rng(n)
    return Mechanism([turned_body(i, WORLD if i == 0 else f"link{(i - 1) // 2 + 1}", rng) for i in range(n)])


def turned_body(i: int, parent: str, rng: np.random.Generator) -> Body:
    """Body i of these, on a hinge whose frame is turned by a quarter turn, or by none."""
    turn = rotation(np.array([1.0, 0.0, 0.0]), (0.0, math.pi / 2, -math.pi / 2)[i % 3])
    joint = Joint("revolute", position=(0.1, 0.0, 0.3) if i else (0.0, 0.0, 0.0), orientation=turn, damping=0.1)
    return Body(f"link{i + 1}", joint, parent, *inertial_numbers(rng))


def inertial_numbers(rng: np.random.Generator) -> tuple[float, Array, Array]:
    """Mass [kg], center [m] and inertia [kg m^2] of a body without symmetry."""
    mixed = rng.normal(size=(3, 3))
    second = 0.05 * mixed @ mixed.T + 0.01 * np.eye(3)  # of mass; any such matrix is a body's
    mass, center = float(rng.uniform(1.0, 2.0)), 0.1 * rng.normal(size=3)
    return mass, center, np.trace(second) * np.eye(3) - second
