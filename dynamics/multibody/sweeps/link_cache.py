"""SharedParts: what mechanisms that derive from one another by a change have in common, each computed once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

import cgraph as cg
from cgraph import Node

from ..algebra import spatial
from ..body import Body, checked
from ..composed_joints import parts_of
from .links import Link, axes_of, link
from .outward import Motion, energy, propagate_motion


class Moved(NamedTuple):
    """The motions of a body's parent and of the body, and its partial Lagrangian."""

    parent: Motion
    motion: Motion
    partial: Node


class SharedParts:
    """Bodies checked, their links, motions and energies. Bodies are not to be altered."""

    def __init__(self) -> None:
        self._bodies: WeakKeyDictionary[Body, tuple[Body, ...]] = WeakKeyDictionary()
        self._links: WeakKeyDictionary[Body, tuple[Body | None, Link]] = WeakKeyDictionary()  # with the parent
        self._grounds: dict[tuple[object, ...], Motion] = {}
        self._moved: dict[tuple[object, ...], Moved] = {}

    def __reduce__(self) -> tuple[type[SharedParts], tuple[()]]:
        return SharedParts, ()  # a copy in another process computes its own

    def parts(self, body: Body) -> tuple[Body, ...]:
        """The bodies that a body is, one but for a composed joint, checked; the last is itself."""
        known = self._bodies.get(body) if isinstance(body, Body) else None
        if known is None:
            known = tuple([checked(part) for part in parts_of(body)])
            self._bodies[body] = known
        return known

    def link(self, body: Body, parent: Body | None) -> Link:
        """The link of a checked body."""
        known = self._links.get(body)
        if known is None or known[0] is not parent:
            with cg.tag(body.name):
                known = self._links[body] = parent, link(body, axes_of(parent) if parent else np.eye(3))
        return known[1]

    def ground(self, rest: Motion) -> Motion:
        """The world at rest, the same object for equal motions."""
        return self._grounds.setdefault((rest.strength, *[spatial.plain(each) for each in rest.vertical]), rest)

    def moved(self, parent: Motion, body: Body, link: Link, q: Sequence[Node], u: Sequence[Node]) -> Moved:
        """The motion and energy of a body whose parent moves so. `parent` is one of these motions, or the ground's."""
        joint = body.joint.type
        key = (id(parent), body.name, joint, link.angle, *[node.name for node in (*q, *u)], *link.numbers)
        if key not in self._moved:
            with cg.tag(body.name):
                motion = propagate_motion(parent, link, joint, link.at(q), u)
                self._moved[key] = Moved(parent, motion, energy(motion, link, joint, q, u))
        return self._moved[key]
