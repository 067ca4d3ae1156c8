"""Checks: what may be a name, and the error that a graph raises about itself."""

from __future__ import annotations


class GraphError(ValueError):
    """A graph is not well formed, or is asked about inputs, outputs or nodes that it does not have."""


MAX_LENGTH = 1000  # characters; a derived name, such as that of a second derivative, still fits


def check_name(what: str, name: str, *, spaces: bool = True) -> str:
    """The name, if it is 1 to 1000 printable characters; spaces: whether it may have any. Raises TypeError, ValueError.

    Refused are control characters, characters without a glyph, and halves of surrogate pairs.
    """
    if not isinstance(name, str):
        raise TypeError(f"the name of {what} must be a string, got {type(name).__name__}: {name!r:.60}")
    if not name:
        raise ValueError(f"the name of {what} must not be empty")
    if len(name) > MAX_LENGTH:
        raise ValueError(f"the name of {what} must have at most {MAX_LENGTH} characters, got {len(name)}: {name!r:.60}")
    if not name.isprintable():
        first = next(character for character in name if not character.isprintable())
        raise ValueError(f"the name of {what} must be printable, got {first!r} in {name!r:.60}")
    if not spaces and " " in name:
        raise ValueError(f"the name of {what} must be without white space, got {name!r:.60}")
    return str(name)
