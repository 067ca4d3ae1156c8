"""Stability: the table of stiff and extreme cases, a result a row, and its forms as text, plain data and CSV."""

import itertools
import math
import textwrap
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ...multiprecision.decimal_numbers import mpmath_context
from ..text_table import GAPS, WIDTH, csv_text, number, table
from ..timing import load, machine
from . import case_runs, energy_drift, single_evaluations
from .case_result import CaseResult, Measurement

QUICK = (  # cases of a quick run: one of each kind, none that takes a while to compile
    "spring pendulum, k = 1e+12",
    "damped spring pendulum, k = 1e+12",
    "Van der Pol, mu = 1e+06",
    "Robertson, to 1e11",
    "mass ratio 1e+12",
    "mass matrix of condition 4e+12",
    "massless links with armature",
    "Kepler, e = 0.99",
    "heavy top",
    "relativistic oscillator",
    "Kapitza's pendulum",
    "next to the upright",
    "angle of 1e+15 rad",
    "smallest velocity",
)

ABOUT = {
    case_runs.SECTION: "Runs with a relative tolerance of 1e-9 and an absolute one of 1e-12 in SI units. An error is "
    "that of the state at the end against a solution in multiprecision, of each state relative to its "
    "natural size; an invariant's is its largest change during the run, relative to its natural scale.",
    energy_drift.SECTION: "Equal steps. The drift is the slope of the energy over the run, by least squares through "
    "the Hann-weighted means of 16 blocks, times the length of the run; the band is the largest less the smallest "
    "energy. Both relative to the energy at the start.",
    single_evaluations.SECTION: "The largest error of torques or accelerations, in units of 2^-52 of the largest "
    "component's size, where a size is |y_i| + sum_j |dy_i/dx_j| |x_j| over all inputs and parameters: the "
    "componentwise condition. 1 is what rounding the data once would do. Exact values from the same equations, "
    "with all data as inputs, in 200 digits; the worst of five random states, backends, single points and batches.",
}


def run(quick: bool = False, say: Callable[[str], None] = lambda line: None) -> list[CaseResult]:
    """All results. say: told of each row.

    quick: some of the cases, shorter runs, shorter arms: seconds in place of minutes.
    Raises ImportError without mpmath.
    """
    rows = []
    for row in results(quick):
        rows.append(row)
        say(f"{row.verdict:<11} {row.case}, {row.method}")
    return rows


def results(quick: bool = False) -> Iterator[CaseResult]:
    """All results, as they are measured."""
    mpmath_context(single_evaluations.DIGITS)  # minutes before it is used
    yield from case_runs.results(QUICK if quick else None)
    yield from energy_drift.results(energy_drift.QUICK if quick else energy_drift.STEPS)
    yield from single_evaluations.results(single_evaluations.QUICK if quick else single_evaluations.LINKS)


def to_dict(rows: Sequence[CaseResult], seconds: float, quick: bool = False) -> dict[str, Any]:
    """Everything as plain data, for JSON and for drawing. seconds: of the whole run."""
    return {
        "machine": machine(),
        "load": load(),
        "date": time.strftime("%Y-%m-%d"),
        "seconds": seconds,
        "quick": quick,
        "sections": [
            {"name": name, "about": about, "rows": [row.to_dict() for row in rows if row.section == name]}
            for name, about in ABOUT.items()
        ],
    }


def to_csv(results: Sequence[CaseResult]) -> str:
    """A line for each measurement."""
    of_row, of_value = "section case method verdict".split(), "quantity value bound unit meets".split()
    of_run = "steps rejected seconds stopped reason".split()
    rows = [row | each for row in [one.to_dict() for one in results] for each in row["measurements"]]
    columns = [*of_row, *of_value, *of_run]
    return csv_text(columns, [[row[name] for name in columns] for row in rows])


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
    """Count of each verdict."""
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
