"""Source lines: where a person wrote a node, recorded on request and carried on to all that derives from it."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..core.label import Label, SourceLine
from ..core.node import Node
from ..core.scope import Scope, current
from ..operations.operation import Op

# Packages whose lines say nothing to the person who calls: this library, and what calls back from between.
_SKIPPED = frozenset({"cgraph", "dynamics", "functools", "numpy"})


@contextmanager
def recording_lines() -> Iterator[None]:
    """Record the source line of every node written inside the `with` block, for `node.lines`, `lint` and `why`.

    It is the line of the nearest caller outside this library: where an expression stands, or where a function of the
    library that writes a model was called. Derived nodes take the lines of their origin, as they take its tags. Outside
    the block nothing is recorded, and building costs no more.

    Examples
    --------
    >>> import cgraph as cg
    >>> with cg.recording_lines():
    ...     square = cg.variable("x") ** 2
    >>> len(square.lines)  # the line `square = ...`
    1
    """
    scope = current.get()
    build = scope.build or Node
    folder = str(Path.cwd() / "_")[:-1]

    def recorded(op: Op, args: tuple[Node, ...], label: Label) -> Node:
        line = _caller(folder)
        return build(op, args, label.at(line) if line else label)

    token = current.set(Scope(scope.label, recorded))
    try:
        yield
    finally:
        current.reset(token)


def _caller(folder: str) -> SourceLine | None:
    """The line that the nearest frame outside the library is at; its file is relative where it lies in `folder`."""
    frame = sys._getframe(1)
    while frame.f_globals.get("__name__", "").partition(".")[0] in _SKIPPED:
        if frame.f_back is None:
            return None
        frame = frame.f_back
    return SourceLine(frame.f_code.co_filename.removeprefix(folder), frame.f_lineno)


def lines_text(nodes: Iterable[Node], most: int = 4) -> str:
    """`arm.py:12, arm.py:14` for the lines of nodes, in order; of many the first, and how many more; empty if none."""
    lines = sorted({line for node in nodes for line in node.lines})
    more = [f"{len(lines) - most} more"] if len(lines) > most else []
    return ", ".join([*map(str, lines[:most]), *more])
