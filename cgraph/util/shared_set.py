"""SharedSet: an immutable set that shares most of its members with the sets that it was made from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

PART = 16  # members that a set of its own may have; a larger one is a chain of parts of at least this size


class SharedSet:
    """An immutable set: its members in `part`, and those of `base`, none in both.

    A union of a large and a small set refers to the large one and copies the small one, so that n sets that grow one
    from the other take memory in proportion to n.
    """

    __slots__ = ("base", "part", "size")

    def __init__(self, part: frozenset[Any], base: SharedSet | None = None) -> None:
        self.part, self.base = part, base
        self.size: int = len(part) + (0 if base is None else base.size)

    def __len__(self) -> int:
        return self.size

    @property
    def members(self) -> frozenset[Any]:
        """All members."""
        return self.part if self.base is None else frozenset().union(*self._parts())

    @property
    def key(self) -> frozenset[Any] | SharedSet:
        """What a dictionary may know the set by: its members, or itself where they are many."""
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
            return SharedSet(frozenset(list(left)), self)  # anew: a difference keeps the memory of all it came from
        return SharedSet(self.part | left, self.base)

    def _parts(self) -> Iterator[frozenset[Any]]:
        rest: SharedSet | None = self
        while rest is not None:
            yield rest.part
            rest = rest.base
