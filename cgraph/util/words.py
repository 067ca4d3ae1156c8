"""Words of messages: numbers of things, and what somebody may have meant by a name that is not there."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import TypeVar

Entry = TypeVar("Entry")
_MOST_NAMES, _LONGEST_NAME = 5000, 80  # names compared, and characters of each: an error should come at once
_ALIKE = 0.7  # share of the letters that two names have in common at least
_MOST_LISTED = 12  # names that are listed where none is near


def counted(number: int, noun: str) -> str:
    """The number, at least 0, and the noun, in the plural of all but 1."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def nearest(name: str, known: Iterable[str], most: int = 3) -> list[str]:
    """The known names, at most so many, that are spelled most like a name, whatever their case; the best first."""
    folded: dict[str, str] = {}
    for each in islice(known, _MOST_NAMES):
        folded.setdefault(each[:_LONGEST_NAME].casefold(), each)
    return [folded[each] for each in difflib.get_close_matches(name[:_LONGEST_NAME].casefold(), folded, most, _ALIKE)]


def or_nearest(name: str, known: Sequence[str]) -> str:
    """End of an error that begins with "there is no ...": the nearest of the known names, or some of them."""
    if near := nearest(name, known):
        return f"did you mean {' or '.join(map(repr, near))}?"
    return f"it has {listed(known) or 'none'}"


def entry(what: str, table: Mapping[str, Entry], name: str) -> Entry:
    """The entry of that name. Raises ValueError for any other.  what: "there is no .."."""
    if isinstance(name, str) and name in table:
        return table[name]
    raise ValueError(f"{what} {name!r:.80}; {or_nearest(str(name), list(table))}")


def listed(names: Sequence[str]) -> str:
    """The names; of many the first, and the last."""
    return ", ".join(names if len(names) <= _MOST_LISTED else [*names[: _MOST_LISTED - 2], "...", names[-1]])
