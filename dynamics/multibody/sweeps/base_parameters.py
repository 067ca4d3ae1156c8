"""Base parameters: the inertial numbers of links that their motion can show, in as few of them as there can be.

Of a link on a hinge three things move with its parent whatever the hinge does: its mass, taken at the joint, the part
of its first moment along the axis, and the part of its inertia that is alike about every axis across. Of a link on a
slide so does its inertia. Given to the parent, they leave the sum of all energies as it was, and the link with seven
numbers in place of ten. What is given to the world shows in no motion and is gone.
(H. Mayeda, K. Yoshida, K. Osuka, "Base parameters of manipulator dynamic models", IEEE Trans. Robotics and Automation
6(3), 1990; M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots", 1990.)
"""

from collections.abc import Sequence

import numpy as np

from cgraph._shared import Array
from cgraph.extend import Builder, building

from ..joints import JointType
from .links import Link, Numbers


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
            given = Numbers(*joints[i].unobservable(*result[i].inertial))
            less, seen = result[i].with_more(given.negated()), _seen_by_parent(links[i], given)
            if parents[i] < 0:
                result[i], world = less, world + seen.moment
                continue
            old = result[i], result[parents[i]]
            new = less, old[1].with_more(seen)
            if not fewer or sum(map(_count, new)) < sum(map(_count, old)):
                result[i], result[parents[i]] = new
    return result, world


def without_axial_moments(links: Sequence[Link], joints: Sequence[JointType], parents: Sequence[int]) -> list[Link]:
    """The links, those that turn about z without the second moment along it, and those that slide without any.

    Their parents have it in their place. Base parameters leave none of the moment of inertia about y instead, which
    serves wrenches. Links stay as they are where there are parameters among their numbers.
    """
    result = list(links)
    if not all([link.is_numeric for link in links]):
        return result
    for i in reversed(range(len(links))):
        if joints[i].has_axis:
            own = result[i].inertial.inertia
            along = 0.5 * (own[0, 0] + own[1, 1] - own[2, 2]) * np.diag([1.0, 1.0, 0.0])
            given = Numbers(0.0, np.zeros(3), along if joints[i].turns else own)
            result[i] = result[i].with_more(given.negated())
            if parents[i] >= 0:
                result[parents[i]] = result[parents[i]].with_more(_seen_by_parent(links[i], given))
    return result


def _count(link: Link) -> int:
    """Number of inertial numbers that are not zero."""
    mass, moment, inertia = link.inertial
    return int(np.count_nonzero([mass, *moment, *inertia[np.tril_indices(3)]]))


def _seen_by_parent(link: Link, given: Numbers) -> Numbers:
    """Inertial numbers at the link's joint, about the parent's origin and in its axes."""
    return given.turned(np.array(link.turn, dtype=np.float64)).about(link.offset)
