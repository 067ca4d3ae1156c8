"""Stability: the table of stiff and extreme cases, a verdict a row, and its forms as plain data and as CSV."""

from __future__ import annotations

import csv
import io
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from ..speed.bench_table import machine
from ..work_precision import energy_drift
from . import case_runs, huge_angles, single_evaluations
from .verdict import Verdict

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
    "componentwise condition. 1 is what rounding the data once would do. Exact values from closed formulas with a "
    "dense solve in multiprecision; the worst of five random states, backends, single points and batches.",
    huge_angles.SECTION: "The largest error over random angles, in units of the last place of the exact value.",
}


def run(quick: bool = False, say: Callable[[str], None] = lambda line: None) -> list[Verdict]:
    """All verdicts. say: told of each section begun, and of each row.

    quick: some of the cases, shorter runs, shorter arms: seconds in place of minutes.
    Raises ImportError without python-flint.
    """
    found = []
    for verdict in verdicts(quick):
        found.append(verdict)
        say(f"{verdict.words:<11} {verdict.case}, {verdict.method}")
    return found


def verdicts(quick: bool = False) -> Iterator[Verdict]:
    """All verdicts, as they are found."""
    yield from case_runs.verdicts(QUICK if quick else None)
    yield from energy_drift.verdicts(energy_drift.QUICK if quick else energy_drift.STEPS)
    yield from single_evaluations.verdicts(single_evaluations.QUICK if quick else single_evaluations.LINKS)
    yield from huge_angles.verdicts(huge_angles.QUICK if quick else huge_angles.COUNT)


def content(found: Sequence[Verdict], seconds: float, quick: bool = False) -> dict[str, Any]:
    """Everything as plain data, for JSON and for drawing. seconds: of the whole run."""
    return {
        "machine": machine(),
        "load": _load(),
        "date": time.strftime("%Y-%m-%d"),
        "seconds": seconds,
        "quick": quick,
        "sections": [
            {"name": name, "about": about, "rows": [each.to_dict() for each in found if each.section == name]}
            for name, about in ABOUT.items()
        ],
    }


def _load() -> float | None:
    """The load of the machine over the last minute; None where it is not told."""
    with suppress(OSError, AttributeError):
        return os.getloadavg()[0]
    return None


def to_csv(found: Sequence[Verdict]) -> str:
    """A line for each figure."""
    text = io.StringIO()
    columns = "section case method verdict quantity value bound unit meets".split()
    columns += "steps rejected seconds stopped reason".split()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for verdict in found:
        row = verdict.to_dict()
        for figure in row["figures"]:
            known = row | figure
            writer.writerow({name: known[name] for name in columns})
    return text.getvalue()
