"""Labels: the tags, roles and source lines that a node carries."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Iterator
from typing import Any, Generic, NamedTuple, TypeVar
from weakref import WeakValueDictionary

INPUT, PRIMAL, ADJOINT, TANGENT, SMOOTH = "input", "primal", "adjoint", "tangent", "smooth"
Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Interned(Generic[Key, Value]):
    """A table from keys to the one object of each; it keeps none of them alive."""

    def __init__(self) -> None:
        self._table: WeakValueDictionary[Key, Value] = WeakValueDictionary()
        self._lock = threading.RLock()  # reentrant: the garbage collector may run inside, and ask for an object
        self.get = self._table.get  # the object of a key, or None; without the lock

    def get_or_make(self, key: Key, make: Callable[[], Value]) -> Value:
        """The object of a key, made if there is none; two threads that ask at once get the same."""
        with self._lock:
            value = self._table.get(key)
            if value is None:
                value = self._table[key] = make()
            return value


PART = 16  # members from which on a part is no longer copied: what is added becomes the next part of a chain


class SharedSet:
    """An immutable set: its members in `part`, and those of `base`, none in both.

    A union of a large and a small set refers to the large one and copies the small one, so that n sets that grow one
    from the other take memory in proportion to n.
    """

    __slots__ = ("base", "part", "size")

    def __init__(self, part: frozenset[Any], base: SharedSet | None = None) -> None:
        self.part, self.base = part, base
        self.size: int = len(part) + (0 if base is None else base.size)

    @property
    def members(self) -> frozenset[Any]:
        """Set of all members."""
        return self.part if self.base is None else frozenset().union(*self._parts())

    @property
    def key(self) -> frozenset[Any] | SharedSet:
        """Key of the set in a dictionary: its members, or itself where they are many."""
        return self.part if self.base is None else self

    def __or__(self, other: SharedSet) -> SharedSet:
        if self is other or not other.size:
            return self
        if not self.size:
            return other
        large, small = (self, other) if self.size >= other.size else (other, self)
        return large.add(small.members)

    def add(self, members: frozenset[Any]) -> SharedSet:
        """The union with some members."""
        left = members.difference(*self._parts())
        if not left:
            return self
        if len(self.part) >= PART:
            return SharedSet(frozenset(list(left)), self)  # copied: a difference keeps memory for all of them
        return SharedSet(self.part | left, self.base)

    def _parts(self) -> Iterator[frozenset[Any]]:
        rest: SharedSet | None = self
        while rest is not None:
            yield rest.part
            rest = rest.base


class SourceLine(NamedTuple):
    """A line of a file that somebody wrote."""

    file: str
    number: int

    def __str__(self) -> str:
        return f"{self.file}:{self.number}"


class Label:
    """Meaning of a node: tags of the person who wrote it, roles from differentiation, and source lines.

    Labels of the same sets are one object, so that most comparisons are of pointers.
    roles: among "input", "primal", "adjoint", "tangent", "smooth", see `Node`.
    """

    __slots__ = ("__weakref__", "_derived", "_lines", "_tags", "has_tags", "roles")

    def __init__(self, tags: SharedSet, roles: frozenset[str], lines: SharedSet) -> None:
        self._tags, self.roles, self._lines = tags, roles, lines
        self.has_tags = tags.size > 0
        self._derived: dict[str, Label] = {}

    @property
    def tags(self) -> frozenset[str]:
        """Set by `cg.tag`; a derived node inherits those of its origin."""
        return self._tags.members

    @property
    def lines(self) -> frozenset[SourceLine]:
        """Source lines where the node was written; empty unless `cg.recording_lines` was on."""
        return self._lines.members

    def derived(self, role: str) -> Label:
        """The label of a derivative node: tags and lines of its origin, and the role of the derivative."""
        found = self._derived.get(role)
        if found is None:
            roles = (self.roles - {INPUT, PRIMAL, SMOOTH}) | {role}
            found = self if roles == self.roles else _label(self._tags, roles, self._lines)
            if found is not self:  # a label that refers to itself would wait for the garbage collector
                self._derived[role] = found
        return found

    def tagged(self, tags: frozenset[str]) -> Label:
        """This label with more tags."""
        return _label(self._tags.add(tags), self.roles, self._lines)

    def at(self, line: SourceLine) -> Label:
        """This label with one more line."""
        return _label(self._tags, self.roles, self._lines.add(frozenset({line})))

    def with_tags_of(self, other: Label) -> Label:
        """This label with the tags of another added, and with the other's lines if it has none."""
        if not other.has_tags and not other._lines.size:
            return self
        return _label(self._tags | other._tags, self.roles, self._lines if self._lines.size else other._lines)

    def union(self, other: Label) -> Label:
        """The label of two nodes merged into one, which is smooth if both are."""
        if self is other:
            return self
        roles = (self.roles | other.roles) - ({SMOOTH} - (self.roles & other.roles))
        return _label(self._tags | other._tags, roles, self._lines | other._lines)

    def __repr__(self) -> str:
        return f"<Label {sorted(self.tags)} {sorted(self.roles)} {sorted(self.lines)}>"


_labels: Interned[tuple[object, frozenset[str], object], Label] = Interned()


def label(
    tags: frozenset[str] = frozenset(),
    roles: frozenset[str] = frozenset(),
    lines: frozenset[SourceLine] = frozenset(),
) -> Label:
    """The label with these tags, roles and lines."""
    return _label(SharedSet(tags), roles, SharedSet(lines))


def _label(tags: SharedSet, roles: frozenset[str], lines: SharedSet) -> Label:
    key = (tags.key, roles, lines.key)
    return _labels.get(key) or _labels.get_or_make(key, lambda: Label(tags, roles, lines))


UNLABELLED = label()
WRITTEN = label(roles=frozenset({PRIMAL}))
