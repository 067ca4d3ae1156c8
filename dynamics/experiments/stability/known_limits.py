"""Limits: the reason of every row of the stability table that is known not to meet its bound, and how far it is off."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .case_result import Measurement


class Limit(NamedTuple):
    """Why a bound is not met.  within: the largest measurement that the reason accounts for, in bounds."""

    reason: str
    within: float


_CLOSE = (
    "At the pericentre the energy is a difference of terms 2 / (1 - e) times as large, so that an error of 1e-9 in a "
    "step there counts so many times, at every passage. A relative tolerance of 1e-11 meets the bound."
)
_HEAVY = (
    "Elimination from the tip to the base: two joints take up all the inertia of a heavy link at the end, and what is "
    "left for the next joints, that of the light links, is the difference of two large numbers. Float64 keeps little "
    "of it at 12 decades; double-double meets the bound."
)

# (section, case, method); an empty method stands for every one.
LIMITS: dict[tuple[str, str, str], Limit] = {
    ("Cases", "Kepler, e = 0.99", "dop853"): Limit(_CLOSE, 10.0),
    ("Cases", "Kepler, e = 0.999", "dop853"): Limit(_CLOSE, 10.0),
    ("Cases", "Kepler, e = 0.999", "dopri5"): Limit(_CLOSE, 10.0),
    ("Single evaluations", "forward dynamics, last mass 1e12", ""): Limit(_HEAVY, 1e12),
}


def reason(section: str, case: str, method: str, measurements: Sequence[Measurement]) -> str:
    """The known reason why measurements are beyond their bounds; empty if there is none, or they are too far off."""
    limit = LIMITS.get((section, case, method)) or LIMITS.get((section, case, ""))
    if limit is None or not all([each.value <= limit.within * each.bound for each in measurements]):
        return ""
    return limit.reason
