"""Table of the stability report, as text for a terminal: a line or two for each case and method."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections import Counter
from collections.abc import Sequence

from .stability import ABOUT
from .verdict import Figure, Verdict

WIDTH = 120  # characters
GAP = "  "
NAMES = 34  # characters of a case's name on a line


def table(found: Sequence[Verdict]) -> str:
    """All sections, with the reason under each limit, and a line of counts."""
    lines = []
    for section, about in ABOUT.items():
        rows = [each for each in found if each.section == section]
        if rows:
            lines += [section, *textwrap.wrap(about, WIDTH), "", *_section(rows), ""]
    return "\n".join([*lines, summary(found)])


def summary(found: Sequence[Verdict]) -> str:
    """How many of each verdict."""
    counts = Counter(each.words for each in found)
    return f"{len(found)} rows: {', '.join(f'{counts[word]} {word}' for word in ('meets', 'limit', 'unexplained'))}"


def _section(rows: Sequence[Verdict]) -> list[str]:
    runs = any(each.steps or each.rejected for each in rows)
    names = min(NAMES, max(len(each.case) for each in rows))
    methods = max(len(each.method) for each in rows)
    steps = max([len(_steps(each)) for each in rows] + [len("steps")]) if runs else 0
    taken = [11, names, methods, *([steps, 8] if runs else [])]
    figures = WIDTH - sum(taken) - len(taken) * len(GAP)
    head = ["verdict".ljust(11), "case".ljust(names), "method".ljust(methods)]
    head += ["steps".rjust(steps), "time".rjust(8)] if runs else []
    lines = [GAP.join([*head, "figures, and in brackets their bounds"])]
    for row, after in itertools.zip_longest(rows, rows[1:]):
        left = textwrap.wrap(row.case, names)
        right = _packed([_figure(each) for each in row.figures], figures)
        for k in range(max(len(left), len(right))):
            cells = [row.words if k == 0 else "", left[k] if k < len(left) else "", row.method if k == 0 else ""]
            parts = [cells[0].ljust(11), cells[1].ljust(names), cells[2].ljust(methods)]
            if runs:
                counted = (_steps(row), f"{row.seconds:.2f} s") if k == 0 else ("", "")
                parts += [counted[0].rjust(steps), counted[1].rjust(8)]
            lines.append(GAP.join([*parts, right[k] if k < len(right) else ""]).rstrip())
        if not row.meets and (after is None or after.meets or _why(after) != _why(row)):  # once for rows that share it
            lines += textwrap.wrap(_why(row), WIDTH, initial_indent=" " * 13, subsequent_indent=" " * 13)
    return lines


def _why(row: Verdict) -> str:
    return ": ".join(filter(None, [row.stopped, row.reason or "no reason is known"]))


def _steps(row: Verdict) -> str:
    return f"{row.steps}" + (f"+{row.rejected}" if row.rejected else "")


def _figure(figure: Figure) -> str:
    bound = "" if math.isinf(figure.bound) else f" ({number(figure.bound)})"
    return f"{figure.quantity} {number(figure.value)}{bound}{'' if figure.meets else ' !'}"


def number(value: float) -> str:
    """Two digits."""
    return f"{value:.1e}" if value and not 0.01 <= abs(value) < 1000.0 else f"{value:.2g}"


def _packed(texts: Sequence[str], width: int) -> list[str]:
    """Texts on as few lines as they take, none broken."""
    lines: list[str] = []
    for text in texts:
        if lines and len(lines[-1]) + 2 + len(text) <= width:
            lines[-1] += f", {text}"
        else:
            lines.append(text)
    return lines
