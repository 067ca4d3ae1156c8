"""Labels: the tags and roles that a node carries, and the scope that new nodes are made in."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from .node import Node, Op

INPUT, PRIMAL, ADJOINT, TANGENT = "input", "primal", "adjoint", "tangent"


class SourceLine(NamedTuple):
    """A line of a file that somebody wrote."""

    file: str
    number: int

    def __str__(self) -> str:
        return f"{self.file}:{self.number}"


@dataclass(frozen=True, eq=False)
class Label:
    """What a node means: `tags` given by the person who wrote it, `roles` given by differentiation.

    lines: where it was written, if that was recorded (see `source_lines.py`).

    Labels are interned, so two equal labels are one object and comparing them is a pointer comparison.
    """

    tags: frozenset[str]
    roles: frozenset[str]
    lines: frozenset[SourceLine] = frozenset()

    def derived(self, role: str) -> Label:
        """The label of a derivative node: the tags and lines of its origin and its own role."""
        return _derived(self, role)

    def tagged(self, tags: frozenset[str]) -> Label:
        """This label with more tags."""
        return label(self.tags | tags, self.roles, self.lines)

    def at(self, line: SourceLine) -> Label:
        """This label with a line more."""
        return _at(self, line)

    def with_tags_of(self, other: Label) -> Label:
        """This label with the tags of another as well, and with its lines where it has none of its own."""
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
def _at(own: Label, line: SourceLine) -> Label:
    return label(own.tags, own.roles, own.lines | {line})


@cache
def _derived(origin: Label, role: str) -> Label:
    return label(origin.tags, (origin.roles - {INPUT, PRIMAL}) | {role}, origin.lines)


@cache
def _with_tags_of(own: Label, other: Label) -> Label:
    return label(own.tags | other.tags, own.roles, own.lines or other.lines)


@cache
def _union(a: Label, b: Label) -> Label:
    return label(a.tags | b.tags, a.roles | b.roles, a.lines | b.lines)


UNLABELLED = label()
WRITTEN = label(roles=frozenset({PRIMAL}))


Build = Callable[["Op", tuple["Node", ...], Label], "Node"]


class Scope:
    """What new nodes get: their label, and how they are built (None: kept as written)."""

    __slots__ = ("build", "label")

    def __init__(self, label: Label, build: Build | None) -> None:
        self.label = label
        self.build = build

    def labelled(self, label: Label) -> None:
        """Give the nodes to come this label."""
        self.label = label


current: ContextVar[Scope] = ContextVar("cgraph scope", default=Scope(WRITTEN, None))  # noqa: B039 (see `building`)


@contextmanager
def tag(*tags: str) -> Iterator[None]:
    """Give every node made inside the `with` block these tags: `with cg.tag("link 2", "kinetic"):`.

    Blocks nest, and inner tags add to outer ones. Raises TypeError when a tag is not a non-empty string.
    """
    for each in tags:
        if not isinstance(each, str) or not each:
            raise TypeError(f"a tag must be a non-empty string, got {each!r}")
    scope = current.get()
    token = current.set(Scope(scope.label.tagged(frozenset(tags)), scope.build))
    try:
        yield
    finally:
        current.reset(token)


@contextmanager
def building(build: Build) -> Iterator[Callable[[Label], None]]:
    """Send every node made inside the `with` block through `build`, so plain formulas fold and share.

    Yields a function that sets the label of the nodes to come. It changes the block's own scope, no other: setting a
    field costs a tenth of setting a context variable.

    The garbage collector rests meanwhile. What is built is kept, so its ever longer searches through a growing graph
    would find nothing, and take as long as all the rest.
    """
    scope = Scope(current.get().label, build)
    token = current.set(scope)
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield scope.labelled
    finally:
        if collecting:
            gc.enable()
        current.reset(token)
