"""Table: a tree of bodies as rows of numbers, and the same tree with bodies hung on, taken off, locked and freed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ..algebra import spatial
from ..bodies.body import WORLD, Body
from ..bodies.joint_coordinates import coordinate_names
from ..joints import COMPOSITIONS, TYPES, JointType
from ..sweeps.kinematic_tree import Carrier, locked_at
from ..sweeps.links import Link, link, motion_axes
from ..trees.mechanism import Mechanism
from ..trees.structure import as_subtree, checked_parts

OWN = (np.zeros(3), np.eye(3))
FIXED = TYPES["fixed"]
DERIVED = ("mechanism", "moved")  # what a table keeps beside its fields


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of moving bodies and of welds, parents first.

    numbers: (rows, 31), see `kernels.LENGTHS`.  parents: rows, -1 for the world.  carriers: {body: where it is, by the
    name of a row}.  base: the mechanism before changes; given, locked: its bodies and locked joints now.
    held: {row: its type and numbers} of joints that are locked here.
    """

    bodies: tuple[Body, ...]
    types: tuple[JointType, ...]
    parents: tuple[int, ...]
    numbers: Array
    carriers: Mapping[str, Carrier]
    base: Mechanism
    given: tuple[Body, ...]
    locked: Mapping[str, float | ArrayLike]
    held: Mapping[str, tuple[JointType, Array]] = field(default_factory=dict)

    @cached_property
    def mechanism(self) -> Mechanism:
        """The mechanism of these rows."""
        if self.given is self.base.bodies and self.locked is self.base.locked:
            return self.base
        return replace(self.base, bodies=self.given, locked=self.locked)

    @cached_property
    def moved(self) -> Array:
        """The numbers, without the mass of what is welded to the world."""
        still: list[bool] = []
        for kind, parent in zip(self.types, self.parents, strict=True):
            still.append(not kind.moves and (parent < 0 or still[parent]))
        if not any(still):
            return self.numbers
        numbers = self.numbers.copy()
        numbers[still, 13:] = 0.0
        return numbers

    @property
    def moving(self) -> list[Body]:
        """The bodies whose joints move."""
        return [body for body, kind in zip(self.bodies, self.types, strict=True) if kind.moves]

    def places(self) -> tuple[list[int], list[int]]:
        """Places of the first coordinate and velocity of each row; behind the last, how many there are."""
        counts = [[len(kind.coordinates) for kind in self.types], [len(kind.velocities) for kind in self.types]]
        q, u = (list(accumulate(each, initial=0)) for each in counts)
        return q, u

    def attach(self, given: Any, to: str | None) -> Table | None:
        """The table with bodies hung on it, parents first; None where only the mechanism can do that, or say why not.

        given, to: as of `Mechanism.attach`.
        """
        subtree = as_subtree(given)
        if subtree.forces or subtree.parameters or subtree.locked or subtree.loops or subtree.places:
            return None
        bodies = subtree.with_parent(subtree.parent if to is None else to)
        own, types, parents, carriers = [*self.bodies], [*self.types], [*self.parents], dict(self.carriers)
        numbers: list[list[float]] = []
        names: set[str] = set()
        known = [WORLD, *[body.name for body in (*self.given, *bodies)]]  # no part of a composed joint
        if not all([body.parent in known for body in bodies]):
            return None
        for part in [part for body in bodies for part in checked_parts(body)]:
            at = carriers.get(part.parent)
            if at is None or part.name in carriers or part.name == WORLD:
                return None
            hung = part if at.name == part.parent else _carried(part, at)
            parent = next((k for k, body in enumerate(own) if body.name == at.name), -1)
            numbers.append(_row(link(hung, own[parent].joint if parent >= 0 else None), hung))
            if (kind := hung.joint.type).moves:
                names = names or {*coordinate_names(self.moving)}
                if not names.isdisjoint(new := coordinate_names([part])) or not _resists(kind, numbers[-1]):
                    return None
                names.update(new)
            carriers[part.name] = Carrier(part.name, *OWN)
            own.append(hung)
            types.append(kind)
            parents.append(parent)
        rest: dict[str, Any] = {"numbers": np.concatenate([self.numbers, numbers]), "carriers": carriers}
        rest |= {"given": (*self.given, *bodies), "types": tuple(types), "parents": tuple(parents)}
        return self._with(bodies=tuple(own), **rest)

    def detach(self, name: str) -> Table | None:
        """The table without a body and all that it carries, or None."""
        first = self._row(name)
        if first is None:
            return None
        left, new = list[int](), list[int]()  # rows that stay, and the numbers of all
        for k, parent in enumerate(self.parents):
            stays = k != first and (parent < 0 or new[parent] >= 0)
            new.append(len(left) if stays else -1)
            left += [k] if stays else []
        lost = self.parents[first]
        if lost >= 0 and self.types[lost].moves and not _resists(self.types[lost], self.numbers[lost].tolist()):
            return None
        stay = {self.bodies[k].name for k in left}
        parents = tuple([new[self.parents[k]] if self.parents[k] >= 0 else -1 for k in left])
        carriers = {each: at for each, at in self.carriers.items() if at.name in stay or at.name == WORLD}
        rest: dict[str, Any] = {"numbers": self.numbers[left], "carriers": carriers, "parents": parents}
        rest["given"] = tuple([body for body in self.given if body.name in carriers])
        rest["locked"] = {each: at for each, at in self.locked.items() if each in carriers}
        bodies, types = (tuple([of[k] for k in left]) for of in (self.bodies, self.types))
        return self._with(bodies=bodies, types=types, **rest)

    def lock(self, name: str, at: float | ArrayLike | None) -> Table | None:
        """The table with a joint that stands still, or None. Raises MechanismError for coordinates that it cannot."""
        row = self._row(name)
        if row is None or not self.types[row].moves:
            return None
        kind, numbers = self.types[row], self.numbers.copy()
        at = at if at is not None else kind.neutral if len(kind.neutral) != 1 else 0.0
        where = locked_at(self.bodies[row], at) if kind.coordinates else at
        turn, shift = kind.placement(np.array([0.0, 0.0, 1.0]), np.asarray(where))
        outer = numbers[row, :9].reshape(3, 3)
        numbers[row, 9:12] += outer @ shift
        numbers[row, :9] = (outer @ turn).ravel()
        held, locked = {**self.held, name: (kind, self.numbers[row])}, {**self.locked, name: at}
        return self._with(locked=locked, types=self._types(row, FIXED), numbers=numbers, held=held)

    def unlock(self, name: str) -> Table | None:
        """The table with a joint free again, or None."""
        row, numbers = self._row(name), self.numbers.copy()
        if row is None or name not in self.held:
            return None
        kind, before = self.held[name]
        numbers[row, :13] = before[:13]
        held, locked = ({key: value for key, value in of.items() if key != name} for of in (self.held, self.locked))
        return self._with(locked=locked, types=self._types(row, kind), numbers=numbers, held=held)

    def with_body(self, body: Body) -> Table | None:
        """The table with other numbers of a body, or None."""
        row, (*inner, part) = self._row(body.name), checked_parts(body)
        if row is None or inner or [at.name for at in self.carriers.values()].count(body.name) > 1:
            return None
        old, carrier = self.bodies[row], self.carriers.get(part.parent)
        part = part if carrier is None or carrier.name == part.parent else _carried(part, carrier)
        same = part.parent == old.parent and part.joint.type == self.types[row] == old.joint.type
        if not same or motion_axes(part.joint).tolist() != motion_axes(old.joint).tolist():
            return None
        numbers, parent = self.numbers.copy(), self.parents[row]
        numbers[row] = _row(link(part, self.bodies[parent].joint if parent >= 0 else None), part)
        bodies = (*self.bodies[:row], part, *self.bodies[row + 1 :])
        known = not part.joint.type.moves or _resists(part.joint.type, numbers[row].tolist())
        given = tuple([body if each.name == body.name else each for each in self.given])
        return self._with(given=given, bodies=bodies, numbers=numbers) if known else None

    def _with(self, **fields: Any) -> Table:
        own = {name: value for name, value in vars(self).items() if name not in DERIVED}
        return Table(**{**own, **fields})

    def _types(self, row: int, kind: JointType) -> tuple[JointType, ...]:
        return (*self.types[:row], kind, *self.types[row + 1 :])

    def _row(self, name: str) -> int | None:
        """The row that a body is, if it is one alone."""
        known = [body.joint for body in self.given if isinstance(name, str) and body.name == name]
        if not known or known[0].kind in COMPOSITIONS or self.carriers[name].name != name:
            return None
        return next(k for k, body in enumerate(self.bodies) if body.name == name)


def _carried(body: Body, at: Carrier) -> Body:
    """A body that hangs on one that is welded, on what carries that."""
    joint = body.joint
    position = spatial.placed(at.position, at.orientation, np.asarray(joint.position))
    orientation = spatial.snapped(at.orientation @ np.asarray(joint.orientation))
    return replace(body, parent=at.name, joint=replace(joint, position=position, orientation=orientation))


def _resists(kind: JointType, numbers: Sequence[float]) -> bool:
    """Whether a row has inertia along all velocities of its joint."""
    a, b, c, d, e, f = numbers[17:23]
    return numbers[26] > 0.0 or kind.resists(numbers[13], np.array([[a, b, d], [b, c, e], [d, e, f]]))


def _row(link: Link, body: Body) -> list[float]:
    """The numbers of a row."""
    numbers: list[Any] = link.numbers
    lift = [0.0] * 4 if link.lift is None else [float(link.lift.mass), *link.lift.moment.tolist()]
    return [*numbers[:12], float(body.joint.pitch), *numbers[12:], *lift]


def table_of(mechanism: Mechanism) -> Table:
    """The table of a mechanism without parameters."""
    moving = mechanism.moving
    numbers = [_row(link, body) for link, body in zip(mechanism.links, moving, strict=True)]
    types = tuple([body.joint.type for body in moving])
    parents, bodies = tuple(mechanism.parents), tuple(mechanism.bodies)
    return Table(moving, types, parents, np.array(numbers), mechanism.carriers, mechanism, bodies, mechanism.locked)
