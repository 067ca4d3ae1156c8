"""Base parameters: the inertial numbers of links that their motion can show, in as few of them as there can be.

Of a link on a hinge three things move with its parent whatever the hinge does: its mass, taken at the joint, the part
of its first moment along the axis, and the part of its inertia that is alike about every axis across. Of a link on a
slide so does its inertia. Given to the parent, they leave the sum of all energies as it was, and the link with seven
numbers in place of ten. What is given to the world shows in no motion and is gone.
(H. Mayeda, K. Yoshida, K. Osuka, "Base parameters of manipulator dynamic models", IEEE Trans. Robotics and Automation
6(3), 1990; M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots", 1990.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cgraph.extend import Array, Builder, building

from ..algebra import spatial
from ..algebra.spatial import Triple
from ..joints import JointType
from .links import Link


def base_parameter_links(
    links: Sequence[Link], joints: Sequence[JointType], parents: Sequence[int], *, fewer: bool = False
) -> tuple[list[Link], Array]:
    """The links, parents first, with all that moves with the parent given to it; and the world's first moment [kg m].

    joints: their types.  parents: index of each one's parent, -1 for the world.  fewer: only what leaves fewer numbers
    of the link and its parent that are not zero.
    The sum of the links' energies is the same but for the potential energy of what the world is given, a constant;
    each one's own is another. The links may be such as no body can be: without mass, with a negative inertia.
    """
    result = list(links)
    world = np.zeros(3)
    with building(Builder()):
        for i in reversed(range(len(links))):
            mass, moment, inertia = _numbers(result[i])
            given = joints[i].unobservable(mass, moment, inertia)
            less, seen = _with(result[i], -given[0], -given[1], -given[2]), _seen_by_parent(links[i], *given)
            if parents[i] < 0:
                result[i], world = less, world + seen[1]
                continue
            old = result[i], result[parents[i]]
            new = less, _with(old[1], *seen)
            if not fewer or sum(map(_count, new)) < sum(map(_count, old)):
                result[i], result[parents[i]] = new
    return result, world


def _count(link: Link) -> int:
    """How many inertial numbers are not zero."""
    mass, moment, inertia = _numbers(link)
    return int(np.count_nonzero([mass, *moment, *inertia[np.tril_indices(3)]]))


def _seen_by_parent(link: Link, mass: Any, moment: Array, inertia: Array) -> tuple[Any, Array, Array]:
    """Mass, first moment and inertia at the link's joint, about the parent's origin and in its axes."""
    turn, place = np.array(link.turn, dtype=np.float64), _array(link.place)
    moment, inertia = spatial.product(turn, moment), spatial.product(turn, inertia, turn.T)
    crossed = np.outer(place, moment)
    inertia = spatial.added(inertia, 2.0 * np.trace(crossed) * np.eye(3) - crossed - crossed.T)
    return mass, spatial.added(moment, mass * place), spatial.parallel_axis(inertia, mass, place)


def _numbers(link: Link) -> tuple[Any, Array, Array]:
    """Mass, first moment and inertia: floats, or nodes where there are parameters."""
    inertia = [[link.inertia[max(i, j)][min(i, j)] for j in range(3)] for i in range(3)]
    return link.mass, _array(link.moment), np.array(inertia)


def _with(link: Link, mass: Any, moment: Array, inertia: Array) -> Link:
    """The link with these added."""
    old_mass, old_moment, old_inertia = _numbers(link)
    moment, inertia = spatial.added(old_moment, moment), spatial.added(old_inertia, inertia)
    return replace(link, mass=old_mass + mass, moment=spatial.constant(moment), inertia=inertia.tolist())


def _array(triple: Triple) -> Array:
    return np.array([spatial.plain(each) for each in triple])
