"""Planar arms: serial chains of links that swing in a vertical plane, as mechanisms."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from cgraph import Node
from cgraph._shared import real_number

from ...systems.arguments import coefficients, parameters_of, sequence
from ..bodies.body import WORLD, Body, Joint
from ..parameters import Quantity, bound, symbol
from ..trees.mechanism import Mechanism

Number = TypeVar("Number", float, Node)
AXIS = (0.0, -1.0, 0.0)  # of the hinges: a positive angle swings the hanging arm towards +x
TIP = "tip"  # the body without mass that marks the end of the last link


class PlanarLink(NamedTuple, Generic[Number]):
    """One link, of floats or nodes; the joint that carries it is at its upper end."""

    mass: Number  # kg
    length: Number  # m, joint to joint
    center: Number  # m, joint to center of mass
    inertia: Number  # kg m^2, about the center of mass


def planar_arm(
    masses: Sequence[Quantity],
    lengths: Sequence[Quantity],
    damping: Quantity | Sequence[Quantity] = 0.0,
    mass_model: str = "rod",
    gravity: Quantity = 9.81,
    *,
    parameters: Mapping[str, float] | None = None,
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
    parameters : mapping, optional
        {name: value} of the parameters that stand in place of numbers above, see `Body`.

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
    values = parameters_of(parameters)
    rods = [
        (_positive(f"link {i}: mass", mass, "kg", values), _positive(f"link {i}: length", length, "m", values))
        for i, (mass, length) in enumerate(zip(masses, lengths, strict=True), 1)
    ]
    pull = bound(gravity, values)
    if not (isinstance(pull, str | Node) or math.isfinite(real_number("gravity", pull))):
        raise ValueError(f"gravity must be finite, got {pull!r} m/s^2")
    links = [
        (mass, length, length / 2, mass * length * length / 12) if mass_model == "rod" else (mass, length, length, 0.0)
        for mass, length in rods
    ]
    joints = [f"joint {i + 1}" for i in range(len(links))]
    one = isinstance(damping, str | Node | numbers.Real)
    rows: list[Any] = [damping] * len(links) if one else sequence("damping must be", damping)
    friction = coefficients("damping", [symbol(each) for each in rows], joints)
    return arm_of_links(links, friction, symbol(gravity), values)


def _positive(what: str, value: Quantity, unit: str, values: Mapping[str, float]) -> float | Node:
    """The float or node of a quantity that is positive. Raises ValueError where it has a number that is not."""
    number = bound(value, values)
    if not (isinstance(number, str | Node) or (math.isfinite(real_number(what, number)) and number > 0.0)):
        raise ValueError(f"{what} must be positive and finite, got {number!r} {unit}")
    return symbol(value) if isinstance(value, str | Node) else float(number)


def arm_of_links(
    links: Sequence[tuple[float | Node, float | Node, float | Node, float | Node]],
    damping: Sequence[float | Node],
    gravity: float | Node,
    parameters: Mapping[str, float] | None = None,
) -> Mechanism:
    """The planar arm of these rows as `PlanarLink`, with the damping [N m s] of each joint and gravity [m/s^2]."""
    bodies: list[Body] = []
    parent: str = WORLD
    drop: float | Node = 0.0
    for i, ((mass, length, center, moment), coefficient) in enumerate(zip(links, damping, strict=True)):
        joint = Joint("revolute", AXIS, (0.0, 0.0, -drop), damping=coefficient, name=f"joint {i + 1}")
        bodies.append(Body(f"link {i + 1}", joint, parent, mass, (0.0, 0.0, -center), (moment, moment, 0.0)))
        parent, drop = bodies[-1].name, length
    bodies.append(Body(TIP, Joint("fixed", position=(0.0, 0.0, -drop)), parent))
    return Mechanism(bodies, (0.0, 0.0, -gravity), parameters=parameters or {})


def planar_links(arm: Mechanism) -> list[PlanarLink[float]]:
    """The links of a planar arm, from the base outwards."""
    *bodies, _ = numbers_alone = arm.bind().bodies
    drops = [-float(np.asarray(body.joint.position)[2]) for body in numbers_alone[1:]]
    return [
        PlanarLink(float(body.mass), drop, -float(np.asarray(body.center)[2]), float(np.asarray(body.inertia)[0]))
        for body, drop in zip(bodies, drops, strict=True)
    ]
