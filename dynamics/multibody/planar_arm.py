"""Planar arms: serial chains of links that swing in a vertical plane, as mechanisms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cgraph.extend import real_number

from ..systems.arguments import per_coordinate, sequence
from .body import WORLD, Body, Joint
from .mechanism import Mechanism

AXIS = (0.0, -1.0, 0.0)  # of the hinges: a positive angle swings the hanging arm towards +x
TIP = "tip"  # the body without mass that marks the end of the last link


class PlanarLink(NamedTuple):
    """One link; the joint that carries it is at its upper end."""

    mass: float  # kg
    length: float  # m, joint to joint
    center: float  # m, joint to center of mass
    inertia: float  # kg m^2, about the center of mass


def planar_arm(
    masses: Sequence[float],
    lengths: Sequence[float],
    damping: float | Sequence[float] = 0.0,
    mass_model: str = "rod",
    gravity: float = 9.81,
) -> Mechanism:
    """A serial arm of revolute joints in a vertical plane, hanging from a fixed base.

    Joint angles [rad] are relative to the parent link, zero hanging straight down, positive counter-clockwise. The arm
    moves in the plane of x, to the right, and z, up. Bodies are "link 1", "link 2", ... from the base outwards and
    "tip", without mass, at the end; coordinates are "joint 1", "joint 2", ...

    Parameters
    ----------
    masses, lengths : sequence of float
        Positive, one for each link [kg], [m].
    damping : float or sequence of float
        At least 0, for all joints or each [N m s].
    mass_model : str
        "rod", a slender uniform rod with inertia m l^2 / 12; "point", the mass at the link's far end.
    gravity : float
        Downwards [m/s^2].

    Returns
    -------
    Mechanism

    Raises
    ------
    ValueError
        When a number is out of range or the counts differ.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 0.8], lengths=[1.0, 0.5])
    >>> arm.coordinates
    ('joint 1', 'joint 2')
    >>> arm.joint_positions([[0.0, 0.0]]).tolist()
    [[[0.0, 0.0], [0.0, -1.0], [0.0, -1.5]]]
    """
    masses, lengths = sequence("masses must be", masses), sequence("lengths must be", lengths)
    if len(masses) != len(lengths) or not len(masses):
        raise ValueError(f"an arm needs as many masses as lengths, at least one; got {len(masses)} and {len(lengths)}")
    if not isinstance(mass_model, str) or mass_model not in ("rod", "point"):
        raise ValueError(f'mass_model must be "rod" or "point", got {mass_model!r}')
    if not math.isfinite(real_number("gravity", gravity)):
        raise ValueError(f"gravity must be finite, got {gravity!r} m/s^2")
    for i, (mass, length) in enumerate(zip(masses, lengths, strict=True)):
        for what, value, unit in (("mass", mass, "kg"), ("length", length, "m")):
            if not (math.isfinite(real_number(f"link {i + 1}: {what}", value)) and value > 0.0):
                raise ValueError(f"link {i + 1}: {what} must be positive and finite, got {value!r} {unit}")
    links = [
        PlanarLink(mass, length, length / 2, mass * length * length / 12)
        if mass_model == "rod"
        else PlanarLink(mass, length, length, 0.0)
        for mass, length in zip(map(float, masses), map(float, lengths), strict=True)
    ]
    joints = [f"joint {i + 1}" for i in range(len(links))]
    return arm_of_links(links, per_coordinate("damping", damping, joints, minimum=0.0), float(gravity))


def arm_of_links(links: Sequence[PlanarLink], damping: Sequence[float], gravity: float) -> Mechanism:
    """The planar arm of these links, with the damping [N m s] of each joint and gravity [m/s^2]."""
    bodies: list[Body] = []
    parent, drop = WORLD, 0.0
    for i, (link, coefficient) in enumerate(zip(links, damping, strict=True)):
        joint = Joint("revolute", AXIS, (0.0, 0.0, -drop), damping=coefficient, name=f"joint {i + 1}")
        inertia = (link.inertia, link.inertia, 0.0)
        bodies.append(Body(f"link {i + 1}", joint, parent, link.mass, (0.0, 0.0, -link.center), inertia))
        parent, drop = bodies[-1].name, link.length
    bodies.append(Body(TIP, Joint("fixed", position=(0.0, 0.0, -drop)), parent))
    return Mechanism(bodies, (0.0, 0.0, -gravity))


def planar_links(arm: Mechanism) -> list[PlanarLink]:
    """The links of a planar arm, from the base outwards."""
    *bodies, _ = arm.bodies
    drops = [-float(np.asarray(body.joint.position)[2]) for body in arm.bodies[1:]]
    return [
        PlanarLink(float(body.mass), drop, -float(np.asarray(body.center)[2]), float(np.asarray(body.inertia)[0]))
        for body, drop in zip(bodies, drops, strict=True)
    ]
