"""Labels: the tags, roles and source lines that a node carries."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

INPUT, PRIMAL, ADJOINT, TANGENT = "input", "primal", "adjoint", "tangent"


class SourceLine(NamedTuple):
    """A line of a file that somebody wrote."""

    file: str
    number: int

    def __str__(self) -> str:
        return f"{self.file}:{self.number}"


@dataclass(frozen=True, eq=False)
class Label:
    """What a node means: tags of the person who wrote it, roles from differentiation, and source lines.

    Labels are interned: two equal labels are one object, so comparing them is a pointer comparison.

    Attributes
    ----------
    tags : frozenset of str
        Set by `cg.tag`; a derived node inherits those of its origin.
    roles : frozenset of str
        Among "input", "primal", "adjoint", "tangent".
    lines : frozenset of SourceLine
        Where the node was written; empty unless `cg.recording_lines` was on.
    """

    tags: frozenset[str]
    roles: frozenset[str]
    lines: frozenset[SourceLine] = frozenset()

    def derived(self, role: str) -> Label:
        """The label of a derivative node: tags and lines of its origin, and the role of the derivative."""
        return _derived(self, role)

    def tagged(self, tags: frozenset[str]) -> Label:
        """This label with more tags."""
        return label(self.tags | tags, self.roles, self.lines)

    def at(self, line: SourceLine) -> Label:
        """This label with a line more."""
        return _at(self, line)

    def with_tags_of(self, other: Label) -> Label:
        """This label with the tags of another added, and with the other's lines if it has none."""
        return _with_tags_of(self, other) if other.tags or other.lines else self

    def union(self, other: Label) -> Label:
        """The label of two nodes merged into one."""
        return self if self is other else _union(self, other)


def label(
    tags: frozenset[str] = frozenset(),
    roles: frozenset[str] = frozenset(),
    lines: frozenset[SourceLine] = frozenset(),
) -> Label:
    """The one label with these tags, roles and lines."""
    return _interned(tags, roles, lines)


_interned = cache(Label)


@cache
def _at(base: Label, line: SourceLine) -> Label:
    return label(base.tags, base.roles, base.lines | {line})


@cache
def _derived(origin: Label, role: str) -> Label:
    return label(origin.tags, (origin.roles - {INPUT, PRIMAL}) | {role}, origin.lines)


@cache
def _with_tags_of(base: Label, other: Label) -> Label:
    return label(base.tags | other.tags, base.roles, base.lines or other.lines)


@cache
def _union(a: Label, b: Label) -> Label:
    return label(a.tags | b.tags, a.roles | b.roles, a.lines | b.lines)


UNLABELLED = label()
WRITTEN = label(roles=frozenset({PRIMAL}))
