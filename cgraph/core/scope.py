"""The scope that new nodes are made in: their label, and the function that builds them."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from .checks import check_name
from .label import WRITTEN, Label

# (operation, arguments, label) -> node. `node.py` imports this module, which so cannot name the types.
Build = Callable[[Any, tuple[Any, ...], Label], Any]


@dataclass(slots=True, eq=False)
class Scope:
    """Label of new nodes, and the builder that makes them (None: kept as written)."""

    label: Label
    build: Build | None

    def set_label(self, label: Label) -> None:
        """Set the label of the nodes to come."""
        self.label = label


# The default is shared by all threads. A Scope can change, but only `building` lets one change, which it made itself.
current: ContextVar[Scope] = ContextVar("cgraph scope", default=Scope(WRITTEN, None))  # noqa: B039


# Whether nodes are in the hands of somebody who may take them for numbers: then `node == 0` is an error.
formulating: ContextVar[bool] = ContextVar("cgraph formula of a user", default=False)


@contextmanager
def tag(*tags: str) -> Iterator[None]:
    """Give every node made inside the `with` block these tags.

    Blocks nest, and inner tags add to outer ones. A derived node inherits the tags of the node it comes from.

    Parameters
    ----------
    *tags : str
        Words of your choice, such as `"link 2", "kinetic"`.

    Raises
    ------
    TypeError
        If a tag is not a string.
    ValueError
        If it is empty or too long, or has characters that cannot be printed.

    Examples
    --------
    >>> import cgraph as cg
    >>> with cg.tag("link 2", "kinetic"):
    ...     energy = 0.5 * cg.variable("qd") ** 2
    >>> sorted(energy.tags)
    ['kinetic', 'link 2']
    """
    names = frozenset([check_name("a tag", name) for name in tags])
    scope = current.get()
    token = current.set(Scope(scope.label.tagged(names), scope.build))
    try:
        yield
    finally:
        current.reset(token)


@contextmanager
def building(build: Build) -> Iterator[Callable[[Label], None]]:
    """Send every node made inside the `with` block through `build`, in general a `Builder`.

    It gives a function that sets the label of the nodes to come, in a tenth of the time of another `with` block. The
    garbage collector is off inside the block: what is built is kept, so its searches through a growing graph would free
    nothing, and take as long as all the rest.

    >>> import cgraph as cg
    >>> from cgraph.extend import Builder, building
    >>> x = cg.variable("x")
    >>> with building(Builder()):
    ...     print(1.0 * x + 0.0 is x, cg.sin(x) is cg.sin(x))
    True True
    """
    if not callable(build):
        raise TypeError(f"build must be a Builder or a function, got {type(build).__name__}: {build!r:.60}")
    scope = Scope(current.get().label, build)
    token = current.set(scope)
    try:
        with without_collection():
            yield scope.set_label
    finally:
        current.reset(token)


@contextmanager
def without_collection() -> Iterator[None]:
    """The garbage collector is off inside the `with` block: its walks over many new objects would free none of them."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
