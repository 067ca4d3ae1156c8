"""Links for equations: the same bodies, with origins and axes in which more of their numbers are zero.

An axial joint may have its origin anywhere on its axis, and the axes of a hinge may be turned about it. With the
origin where the common normal with the axis of the parent's joint meets it, and the parent's axes turned so that the
normal is along one of them, a joint is placed by (a, 0, d), and its axis turned about one axis of the parent's alone.
(J. Denavit, R. S. Hartenberg, "A kinematic notation for lower-pair mechanisms based on matrices", J. Applied Mechanics
22(2), 1955.) So it is done only where fewer numbers are left, and no origin is moved further than its link and the
parent's move are long: the normal of axes that are nearly parallel may be far away, and the way back takes digits.

Base parameters are the inertial numbers of links that their motion can show, in as few of them as there can be.
Of a link on a hinge three things move with its parent whatever the hinge does: its mass, taken at the joint, the part
of its first moment along the axis, and the part of its inertia that is alike about every axis across. Of a link on a
slide so does its inertia. Given to the parent, they leave the sum of all energies as it was, and the link with seven
numbers in place of ten. What is given to the world shows in no motion and is gone.
(H. Mayeda, K. Yoshida, K. Osuka, "Base parameters of manipulator dynamic models", IEEE Trans. Robotics and Automation
6(3), 1990; M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of serial robots", 1990.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array
from cgraph.extend import Builder, building

from ..algebra import spatial
from ..joints import JointType
from .links import Link, Numbers

_FAR = 100.0  # times the extent of a body, at most, for its origin from where it was: two digits of its numbers
_TURN = 4  # numbers in a turn that is about one axis, less than in one about three: products for every vector


class _Placed(NamedTuple):
    """A link by its numbers, on the way to others.

    reach: how far its origin may be moved [m].  angle: see `Link`.  moved: how far its origin was moved [m].
    """

    turn: Array
    place: Array
    own: Numbers
    joint: JointType
    reach: float = 0.0
    angle: float = 0.0
    moved: float = 0.0
    lift: Numbers | None = None

    @property
    def placed_by(self) -> int:
        """Number of constants in the link's place and turn."""
        turned = int(np.count_nonzero(self.turn[:2, 2]) == 2)
        return int(np.count_nonzero(self.place)) + _TURN * turned

    @property
    def numbers(self) -> int:
        """Number of constants that other origins and axes may have as zeros."""
        _, moment, inertia = self.own
        shown = [moment[0], moment[1], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
        return self.placed_by + int(np.count_nonzero(shown))

    def carried(self, by: _Placed) -> _Placed:
        """Link on the parent as it is now, placed as before the parent's origin was moved and its axes were turned."""
        back = _about_z(-by.angle)
        place = spatial.product(back, spatial.added(self.place, np.array([0.0, 0.0, -by.moved])))
        return self._replace(turn=spatial.snapped(back @ self.turn), place=place)

    def along(self, move: float) -> _Placed:
        """Link with its origin moved along its own axis."""
        place = spatial.added(self.place, move * self.turn[:, 2])
        offset = np.array([0.0, 0.0, -move])
        return self._replace(
            place=place, own=self.own.about(offset), moved=move, lift=self.lift and self.lift.about(offset)
        )

    def turned(self, angle: float) -> _Placed:
        """Link on a hinge with its axes turned about the hinge's."""
        turn = _about_z(-angle)
        return self._replace(own=self.own.turned(turn), angle=angle, lift=self.lift and self.lift.turned(turn))

    def to_normal(self, parent_moved: float) -> _Placed:
        """Link with its origin on the common normal with the parent's axis, unless that is far away."""
        (x, y, z), place = self.turn[:, 2], self.place
        across = x * x + y * y
        move = -(place[0] * x + place[1] * y) / across if across else -place[2] / z
        most = min(self.reach, float(np.linalg.norm(place)) + abs(parent_moved))
        return self.along(float(move)) if self.joint.has_axis and abs(move) <= most else self

    def less_turned(self) -> tuple[_Placed, float]:
        """Link without its constant turn about the hinge's axis, but for quarters; and the angle of that turn.

        As it is where its axis is across no axis of the parent's.
        """
        x, y, z = self.turn[:, 2]
        if (x != 0.0 and y != 0.0) or not self.joint.measured_about_axis:
            return self, 0.0
        left = np.array(
            [[1.0, 0.0, 0.0], [0.0, z, y], [0.0, -y, z]] if x == 0.0 else [[z, 0.0, x], [0.0, 1.0, 0.0], [-x, 0.0, z]]
        )
        rest = left.T @ self.turn
        angle = math.atan2(rest[1, 0], rest[0, 0])
        small = _within_quarter(angle)
        return (self._replace(turn=left @ np.rint(_about_z(angle - small)) + 0.0), small) if small else (self, 0.0)


def equation_links(
    links: Sequence[Link], joints: Sequence[JointType], parents: Sequence[int], *, outwards: bool = False
) -> list[Link]:
    """The links, parents first, moved and turned so. Those with parameters stay, and so do their parents.

    joints: their types.  parents: index of each one's parent, -1 for the world.
    outwards: where as many numbers are left whether an origin is moved or not, always have them further out, where
    fewer columns of a mass matrix meet them; else not where the parent turns about the axis of its own parent, as
    velocities have fewer components there.
    """
    children: list[list[int]] = [[] for _ in links]
    for i, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(i)
    known = {
        i: _Placed(np.array(link.turn, dtype=np.float64), link.offset, link.inertial, joint, lift=link.lift)
        for i, (link, joint) in enumerate(zip(links, joints, strict=True))
        if link.is_numeric
    }
    for i in reversed(range(len(links))):  # from the tips: no further than what is carried by the least body
        if i in known:
            reach = min(
                [_FAR * _extent(known[i].own), *[known[child].reach for child in children[i] if child in known]]
            )
            known[i] = known[i]._replace(reach=reach)
    result = list(links)
    for i, parent in enumerate(parents):
        if i not in known:
            continue
        old, angle = known[i], 0.0
        if parent in known:
            known[i] = known[i].carried(known[parent])
            known[i], angle = known[i].less_turned()
        if all([child in known for child in children[i]]):
            in_plane = parent in known and parents[parent] >= 0 and not known[parent].turn[:2, 2].any()
            further = outwards or not in_plane
            known[i] = _best(known[i], known.get(parent), [known[child] for child in children[i]], further)
        if known[i] is not old:
            new, at = links[i].with_inertial(known[i].own), known[i]
            angle = at.angle + angle  # more than its axes are turned by
            result[i] = replace(new, turn=at.turn.tolist(), offset=at.place, angle=angle, lift=at.lift)
    return result


def _best(own: _Placed, parent: _Placed | None, children: Sequence[_Placed], further: bool) -> _Placed:
    """Moved and turned so that the fewest numbers of it and of what it carries are left; of as many further out."""
    choices = [own]
    if own.joint.has_axis:
        if parent is not None and parent.joint.has_axis:
            choices.append(own.to_normal(parent.moved))
        else:  # where the first of the children has its normal
            moves = [float(child.to_normal(0.0).place[2]) for child in children[:1]]
            choices += [own.along(move) for move in moves if abs(move) <= own.reach]
    if own.joint.measured_about_axis:
        choices += [each.turned(angle) for each in choices for child in children for angle in _turns(each, child)]

    def left(choice: _Placed) -> tuple[int, bool, bool]:
        placed = [each.carried(choice).to_normal(choice.moved) for each in children]
        return (
            choice.numbers + sum([each.placed_by for each in placed]),
            choice.angle != 0.0,
            further == (choice.moved == 0.0),
        )

    return min(choices, key=left)


def _turns(own: _Placed, child: _Placed) -> list[float]:
    """The angle that turns the axes to the common normal with a child's axis, but for quarter turns."""
    placed = child.carried(own).to_normal(own.moved)
    x, y = placed.turn[:2, 2] if placed.turn[:2, 2].any() else placed.place[:2]
    return [_within_quarter(math.atan2(y, x))] if x != 0.0 and y != 0.0 else []


def _extent(body: Numbers) -> float:
    """Distance of a body's mass from its origin, by its moments; infinite without any."""
    return math.sqrt(float(np.abs(body.inertia).max()) / body.mass) if body.mass > 0.0 else math.inf


def _within_quarter(angle: float) -> float:
    """Rest of an angle beside quarter turns; no rounding of one."""
    rest = angle - round(angle / (math.pi / 2)) * (math.pi / 2)
    return rest if abs(rest) > spatial.SNAP else 0.0


def _about_z(angle: float) -> Array:
    return spatial.rotation(np.array([0.0, 0.0, 1.0]), angle)


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
