"""Figures as text: tables for a terminal, CSV, and numbers of two digits."""

import csv
import io
from collections.abc import Iterable, Sequence

from cgraph._shared import or_nearest

WIDTH = 120  # characters of a terminal
GAPS = ("  ", " ")  # between columns: the second where the first is too wide

Cell = str | tuple[str, str]  # a text, or a number and what follows it in its column


def table(header: Sequence[str], rows: Sequence[Sequence[Cell]], left: Iterable[int] = (0,)) -> list[str]:
    """Lines of a table; columns that do not fit go into blocks below, under the first column again.

    left: the columns of texts, flush left. In the others numbers are flush right, and what follows them flush left.
    """
    flush_left = set(left)
    columns = [
        _column(head, [cell if isinstance(cell, tuple) else (cell, "") for cell in cells], k in flush_left)
        for k, (head, *cells) in enumerate(zip(header, *rows, strict=True))
    ]
    first, space = columns[0], WIDTH - len(columns[0][0])
    widths = [len(column[0]) for column in columns[1:]]
    gap = next((gap for gap in GAPS if sum(widths) + len(gap) * len(widths) <= space), GAPS[-1])
    blocks: list[list[list[str]]] = [[]]
    for column in columns[1:]:
        if blocks[-1] and sum(len(gap) + len(each[0]) for each in (*blocks[-1], column)) > space:
            blocks.append([])
        blocks[-1].append(column)
    return [gap.join(parts).rstrip() for block in blocks for parts in zip(first, *block, strict=True)]


def _column(head: str, cells: Sequence[tuple[str, str]], flush_left: bool) -> list[str]:
    """Cells of one width under a head that stands over the numbers."""
    after = max([len(right) for _, right in cells], default=0)
    before = max([len(left) for left, _ in cells] + [len(head) - (after + 1 if after else 0)])
    if flush_left:
        return [text.ljust(before) for text in (head, *[left for left, _ in cells])]
    space = " " if after else ""
    lines = [f"{left:>{before}}{space}{right:<{after}}" for left, right in cells]
    return [head.rjust(before).ljust(before + len(space) + after), *lines]


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """CSV with a line of names; None gives an empty cell."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()


def number(value: float) -> str:
    """The number with two significant digits, with an exponent where it is small or large."""
    return f"{value:.1e}" if value and not 0.01 <= abs(value) < 1000.0 else f"{value:.2g}"


def check_names(*choices: tuple[str, Iterable[str], Iterable[str]]) -> None:
    """Raise ValueError for a name that is not known; choices: of (what they name, names, those known)."""
    for what, names, known in choices:
        if unknown := [name for name in names if name not in known]:
            raise ValueError(f"there is no {what} {unknown[0]!r}; {or_nearest(unknown[0], [*known])}")
