"""Tables under a title, numbers with so many digits, and footnotes."""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from dynamics.experiments.text_table import table


class Table(NamedTuple):
    """A table under its title, as text or as plain data.  left: the columns of texts."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: Iterable[int] = (0,)

    def __str__(self) -> str:
        return "\n".join([*filter(None, [self.title]), *table(self.header, self.rows, self.left)])

    def to_dict(self) -> dict[str, object]:
        """Dictionary for JSON."""
        return {"title": self.title, "header": list(self.header), "rows": [list(row) for row in self.rows]}


def digits(value: float, count: int) -> str:
    """The number with `count` significant digits, without an exponent."""
    if not (math.isfinite(value) and value > 0.0):
        return str(value)
    return f"{value:.{max(0, count - 1 - math.floor(math.log10(value)))}f}"


class Footnotes:
    """Letters for the reasons why cells are empty, and the lines below a table that say them."""

    def __init__(self) -> None:
        self._letters: dict[str, str] = {}

    def mark(self, reason: str) -> str:
        """Letter of a reason."""
        return self._letters.setdefault(reason, string.ascii_lowercase[min(len(self._letters), 25)])

    def lines(self) -> list[str]:
        """A line for each reason."""
        return [f"{letter}: {reason}" for reason, letter in self._letters.items()]


class Wrong(str):
    """A line about what must not be: the exit code tells it, too."""
