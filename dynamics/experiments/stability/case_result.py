"""Case results: measurements of one case by one method beside their bounds, and whether they meet them."""

from __future__ import annotations

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
    def explained(self) -> bool:
        """Whether it meets its bounds or has a reason why not."""
        return self.meets or bool(self.reason)

    @property
    def verdict(self) -> str:
        """In a word."""
        return "meets" if self.meets else "limit" if self.reason else "unexplained"

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON: numbers that are not finite as text."""
        rows = [asdict(each) | {"meets": each.meets} for each in self.measurements]
        for row in rows:
            row |= {key: row[key] if abs(row[key]) < float("inf") else str(row[key]) for key in ("value", "bound")}
        return {**asdict(self), "measurements": rows, "verdict": self.verdict}
