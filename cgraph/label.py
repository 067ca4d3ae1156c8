"""Labels: the tags and roles that a node carries, and the scope that new nodes are made in."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from .node import Node, Op

INPUT, PRIMAL, ADJOINT, TANGENT = "input", "primal", "adjoint", "tangent"


@dataclass(frozen=True, eq=False)
class Label:
    """What a node means: `tags` given by the person who wrote it, `roles` given by differentiation.

    Labels are interned, so two equal labels are one object and comparing them is a pointer comparison.
    """

    tags: frozenset[str]
    roles: frozenset[str]

    def derived(self, role: str) -> Label:
        """The label of a derivative node: the tags of its origin and its own role."""
        return _derived(self, role)

    def tagged(self, tags: frozenset[str]) -> Label:
        """This label with more tags."""
        return label(self.tags | tags, self.roles)

    def union(self, other: Label) -> Label:
        """The label of two nodes merged into one."""
        return self if self is other else _union(self, other)


@cache
def label(tags: frozenset[str] = frozenset(), roles: frozenset[str] = frozenset()) -> Label:
    """The one label with these tags and roles."""
    return Label(tags, roles)


@cache
def _derived(origin: Label, role: str) -> Label:
    return label(origin.tags, (origin.roles - {INPUT, PRIMAL}) | {role})


@cache
def _union(a: Label, b: Label) -> Label:
    return label(a.tags | b.tags, a.roles | b.roles)


UNLABELLED = label()
WRITTEN = label(roles=frozenset({PRIMAL}))


class Scope(NamedTuple):
    """What new nodes get: their label, and how they are built (None: kept as written)."""

    label: Label
    build: Callable[[Op, tuple[Node, ...], Label], Node] | None


current: ContextVar[Scope] = ContextVar("cgraph scope", default=Scope(WRITTEN, None))  # noqa: B039 (immutable)


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
def building(build: Callable[[Op, tuple[Node, ...], Label], Node]) -> Iterator[Callable[[Label], object]]:
    """Send every node made inside the `with` block through `build`, so plain formulas fold and share.

    Yields a function that sets the label of the nodes to come.
    """
    token = current.set(Scope(current.get().label, build))
    try:
        yield lambda label: current.set(Scope(label, build))
    finally:
        current.reset(token)
