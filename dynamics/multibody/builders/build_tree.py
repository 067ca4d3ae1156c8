"""Trees of bodies built from the indices of their parents: `tree` and `serial_arm`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..bodies.body import WORLD, Body, Joint, MechanismError, shape_of, vector
from ..parameters import Quantities
from ..trees.mechanism import Mechanism

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
