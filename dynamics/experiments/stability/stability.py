"""Stability: the table of stiff and extreme cases, a result a row, and its forms as plain data and as CSV."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ...multiprecision.flint_numbers import flint
from ..machine import load, machine
from ..text_table import csv_text
from . import case_runs, energy_drift, huge_angles, single_evaluations
from .case_result import CaseResult

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
    "that of the state at the end against a closed form or a solution in multiprecision, of each state relative to its "
    "natural size; an invariant's is its largest change during the run, relative to its natural scale.",
    energy_drift.SECTION: "Equal steps. The drift is the slope of the energy over the run, by least squares through "
    "the Hann-weighted means of 16 blocks, times the length of the run; the band is the largest less the smallest "
    "energy. Both relative to the energy at the start.",
    single_evaluations.SECTION: "The largest error of torques or accelerations, in units of 2^-52 of the largest "
    "component's size, where a size is |y_i| + sum_j |dy_i/dx_j| |x_j| over all inputs and parameters: the "
    "componentwise condition. 1 is what rounding the data once would do. Exact values from Newton-Euler equations "
    "with a dense solve in multiprecision; the worst of five random states, backends, single points and batches.",
    huge_angles.SECTION: "The largest error over random angles, in units of the last place of the exact value.",
}


def run(quick: bool = False, say: Callable[[str], None] = lambda line: None) -> list[CaseResult]:
    """All results. say: told of each row.

    quick: some of the cases, shorter runs, shorter arms: seconds in place of minutes.
    Raises ImportError without python-flint.
    """
    rows = []
    for row in results(quick):
        rows.append(row)
        say(f"{row.verdict:<11} {row.case}, {row.method}")
    return rows


def results(quick: bool = False) -> Iterator[CaseResult]:
    """All results, as they are measured."""
    flint()  # minutes before it is used
    yield from case_runs.results(QUICK if quick else None)
    yield from energy_drift.results(energy_drift.QUICK if quick else energy_drift.STEPS)
    yield from single_evaluations.results(single_evaluations.QUICK if quick else single_evaluations.LINKS)
    yield from huge_angles.results(huge_angles.QUICK if quick else huge_angles.COUNT)


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
