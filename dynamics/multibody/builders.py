"""Mechanisms from a few numbers: trees of bodies by the indices of their parents, and planar arms."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array, real_number

from ..systems.arguments import coefficients, parameters_of, sequence
from .bodies.body import WORLD, Body, Joint, MechanismError, shape_of, vector
from .parameters import Quantities, Quantity, bound, symbol
from .trees.mechanism import Mechanism

Number = TypeVar("Number", float, Node)
AXIS = (0.0, -1.0, 0.0)  # of the hinges: a positive angle swings the hanging arm towards +x
TIP = "tip"  # the body without mass that marks the end of the last link
_FIELDS = [each.name for each in fields(Body) if each.name not in ("name", "parent")]


def serial_arm(
    links: Sequence[dict[str, Any]],
    gravity: Quantities = (0.0, 0.0, -9.81),
    *,
    parameters: Mapping[str, float] | None = None,
) -> Mechanism:
    """A chain of bodies "link 1", "link 2", ..., each on the one before: `tree` without branches.

    Parameters
    ----------
    links : sequence of dict
        Keyword arguments of `Body` without `name` and `parent`, for each body from the base outwards.
    gravity : array_like, (3,)
        In the world's axes [m/s^2].
    parameters : mapping, optional
        {name: value} of those that links and gravity have.

    Returns
    -------
    Mechanism

    Raises
    ------
    MechanismError
        As `Mechanism` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> hinge = dyn.Joint("revolute", (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
    >>> dyn.serial_arm([{"joint": hinge, "mass": 1.0, "center": (0.0, 0.0, -0.5)}] * 2).coordinates
    ('link 1', 'link 2')
    """
    _check_sequence("links", links)
    return tree(range(-1, len(links) - 1), links, gravity=gravity, parameters=parameters)


def tree(
    parents: Sequence[int],
    links: Sequence[dict[str, Any]] | None = None,
    *,
    axes: ArrayLike = (0.0, 1.0, 0.0),
    gravity: Quantities = (0.0, 0.0, -9.81),
    parameters: Mapping[str, float] | None = None,
) -> Mechanism:
    """A tree of bodies "link 1", "link 2", ...: `tree([(i - 1) // 2 for i in range(15)])` is a binary one.

    Parameters
    ----------
    parents : sequence of int
        For each body the index of the one that carries it, counted from 0, -1 for the world.
    links : sequence of dict, optional
        Keyword arguments of `Body` without `name` and `parent`, for each body. By default each is a slender rod of
        1 kg and 1 m along -z, turning about its upper end, its children at its lower end.
    axes : array_like, (3,) or (n, 3)
        Of the default's hinges, one for all or for each.
    gravity : array_like, (3,)
        In the world's axes [m/s^2].
    parameters : mapping, optional
        {name: value} of those that links and gravity have.

    Returns
    -------
    Mechanism

    Raises
    ------
    MechanismError
        Where the counts differ, for an index out of range, and as `Mechanism` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.tree([-1, 0, 0])
    <Mechanism of 3 bodies, 3 coordinate(s) link 1, link 2, link 3; gravity 0, 0, -9.81>
    """
    _check_sequence("parents", parents)
    if links is not None:
        _check_sequence("links", links)
    n = len(parents)
    for i, parent in enumerate(parents):
        if not isinstance(parent, (int, np.integer)) or not -1 <= parent < n:
            raise MechanismError(f"parents must be indices from -1 to {n - 1}, got {parent!r:.60} for link {i + 1}")
    given = (
        [_rod(axis, parent) for axis, parent in zip(_axes(axes, n), parents, strict=True)] if links is None else links
    )
    if len(given) != n:
        raise MechanismError(f"a tree needs a link for each of its {n} parents, got {len(given)}")
    for i, link in enumerate(given):
        if not isinstance(link, Mapping):
            raise MechanismError(f"links must be mappings, the fields of a Body, got {link!r:.60} for link {i + 1}")
        if unknown := [name for name in link if name not in _FIELDS]:
            raise MechanismError(f"link {i + 1} has {', '.join(_FIELDS)}, got {unknown[0]!r:.60}")
        if "joint" not in link:
            raise MechanismError(f"link {i + 1} needs a joint, got {', '.join(link) or 'nothing'}")
    names = [f"link {i + 1}" for i in range(n)]
    bodies = [
        Body(name, parent=WORLD if parent < 0 else names[parent], **link)
        for name, parent, link in zip(names, parents, given, strict=True)
    ]
    return Mechanism(bodies, gravity, parameters={} if parameters is None else parameters)


def _check_sequence(what: str, given: object) -> None:
    if isinstance(given, str) or not isinstance(given, Sequence | np.ndarray):
        raise MechanismError(f"{what} must be a sequence, got {type(given).__name__}: {given!r:.60}")


def _rod(axis: Array, parent: int) -> dict[str, object]:
    joint = Joint("revolute", axis, (0.0, 0.0, 0.0 if parent < 0 else -1.0))
    return {"joint": joint, "mass": 1.0, "center": (0.0, 0.0, -0.5), "inertia": (1.0 / 12.0, 1.0 / 12.0, 0.0)}


def _axes(given: ArrayLike, n: int) -> Array:
    each = shape_of(given) == (n, 3)
    return vector("axes", given, (n, 3)) if each else np.tile(vector("axes", given), (n, 1))


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
