"""Table of the stability report, as text for a terminal: a line or two for each case and method."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections import Counter
from collections.abc import Sequence

from ..text_table import GAPS, WIDTH, number, table
from .case_result import CaseResult, Measurement
from .stability import ABOUT

NAMES = 34  # characters of a case's name on a line
INDENT = " " * 13  # of a reason


def text(results: Sequence[CaseResult]) -> str:
    """All sections, with the reason under each limit, and a line of counts."""
    lines = []
    for section, about in ABOUT.items():
        rows = [row for row in results if row.section == section]
        if rows:
            lines += [section, *textwrap.wrap(about, WIDTH), "", *_section(rows), ""]
    return "\n".join([*lines, summary(results)])


def summary(results: Sequence[CaseResult]) -> str:
    """How many of each verdict."""
    counts = Counter(row.verdict for row in results)
    return f"{len(results)} rows: {', '.join(f'{counts[word]} {word}' for word in ('meets', 'limit', 'unexplained'))}"


def _section(rows: Sequence[CaseResult]) -> list[str]:
    runs = any(row.steps or row.rejected for row in rows)
    header = ["verdict", "case", "method", *(["steps", "time"] if runs else [])]
    left = [_left(row, runs) for row in rows]
    taken = [max(map(len, column)) for column in zip(header, *[line for lines in left for line in lines], strict=True)]
    space = WIDTH - sum(taken) - len(taken) * len(GAPS[0])
    right = [_packed([_measured(each) for each in row.measurements], space) for row in rows]
    none = [""] * len(header)
    cells = [
        [[*(before or none), after or ""] for before, after in itertools.zip_longest(*pair)]
        for pair in zip(left, right, strict=True)
    ]
    header.append("figures, and in brackets their bounds")
    title, *below = table(header, [line for row in cells for line in row], left=(0, 1, 2, len(none)))
    lines, rest = [title], iter(below)
    for row, of_row, after in itertools.zip_longest(rows, cells, rows[1:]):
        lines += itertools.islice(rest, len(of_row))
        if not row.meets and (after is None or after.meets or _why(after) != _why(row)):  # once for rows that share it
            lines += textwrap.wrap(_why(row), WIDTH, initial_indent=INDENT, subsequent_indent=INDENT)
    return lines


def _why(row: CaseResult) -> str:
    return ": ".join(filter(None, [row.stopped, row.reason or "no reason is known"]))


def _left(row: CaseResult, runs: bool) -> list[list[str]]:
    """The cells before the measurements; a long name goes on in the lines below."""
    run = [f"{row.steps}" + (f"+{row.rejected}" if row.rejected else ""), f"{row.seconds:.2f} s"] if runs else []
    first, *more = textwrap.wrap(row.case, NAMES)
    return [[row.verdict, first, row.method, *run], *[["", part, "", *["" for _ in run]] for part in more]]


def _measured(measurement: Measurement) -> str:
    bound = "" if math.isinf(measurement.bound) else f" ({number(measurement.bound)})"
    return f"{measurement.quantity} {number(measurement.value)}{bound}{'' if measurement.meets else ' !'}"


def _packed(texts: Sequence[str], width: int) -> list[str]:
    """Texts on as few lines as they take, none broken."""
    lines: list[str] = []
    for part in texts:
        if lines and len(lines[-1]) + 2 + len(part) <= width:
            lines[-1] += f", {part}"
        else:
            lines.append(part)
    return lines
