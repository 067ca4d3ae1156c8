"""Case results: measurements of one case by one method beside their bounds, and known reasons where they are beyond."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Measurement:
    """A number and the bound to meet, both in `unit`; `why` is the reason of the bound."""

    quantity: str
    value: float
    bound: float
    unit: str
    why: str

    @property
    def meets(self) -> bool:
        """Whether the number is within the bound; NaN is not."""
        return self.value <= self.bound


@dataclass(frozen=True)
class CaseResult:
    """One row of the stability table.

    stopped: why a run ended before its time, empty if it did not.  seconds: of the steps, without making the program.
    reason: of measurements beyond their bounds, empty where none is known. steps and rejected are 0 where nothing runs.
    """

    section: str
    case: str
    about: str
    method: str
    measurements: tuple[Measurement, ...]
    steps: int = 0
    rejected: int = 0
    seconds: float = 0.0
    stopped: str = ""
    reason: str = ""

    @property
    def meets(self) -> bool:
        """Whether all measurements are within their bounds, of a run that came to its end."""
        return not self.stopped and all([each.meets for each in self.measurements])

    @property
    def verdict(self) -> str:
        """Verdict in a word; a limit is a case that has a reason why it does not meet its bounds."""
        return "meets" if self.meets else "limit" if self.reason else "unexplained"

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON: numbers that are not finite as text."""
        rows = [asdict(each) | {"meets": each.meets} for each in self.measurements]
        for row in rows:
            row |= {key: row[key] if abs(row[key]) < float("inf") else str(row[key]) for key in ("value", "bound")}
        return {**asdict(self), "measurements": rows, "verdict": self.verdict}


_CLOSE = (
    "At the pericentre the energy is a difference of terms 2 / (1 - e) times as large, so that an error of 1e-9 in a "
    "step there counts so many times, at every passage. A relative tolerance of 1e-11 meets the bound."
)
_HEAVY = (
    "Elimination from the tip to the base: two joints take up all the inertia of a heavy link at the end, and what is "
    "left for the next joints, that of the light links, is the difference of two large numbers. Float64 keeps little "
    "of it at 12 decades."
)

# (section, case, method): the reason, and the largest measurement that it accounts for, in bounds; an empty method
# stands for every one.
LIMITS: dict[tuple[str, str, str], tuple[str, float]] = {
    ("Cases", "Kepler, e = 0.99", "dop853"): (_CLOSE, 10.0),
    ("Cases", "Kepler, e = 0.999", "dop853"): (_CLOSE, 10.0),
    ("Cases", "Kepler, e = 0.999", "dopri5"): (_CLOSE, 10.0),
    ("Single evaluations", "forward dynamics, last mass 1e12", ""): (_HEAVY, 1e12),
}


def reason(section: str, case: str, method: str, measurements: Sequence[Measurement]) -> str:
    """The known reason why measurements are beyond their bounds; empty if there is none, or they are too far off."""
    known, within = LIMITS.get((section, case, method)) or LIMITS.get((section, case, "")) or ("", 0.0)
    return known if all([each.value <= within * each.bound for each in measurements]) else ""
