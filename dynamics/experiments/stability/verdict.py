"""Verdicts: figures of one case by one method beside their bounds, and whether they meet them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Figure:
    """A number and the bound to meet, both in `unit`; `why` is the reason of the bound."""

    quantity: str
    value: float
    bound: float
    unit: str
    why: str

    @property
    def meets(self) -> bool:
        """Whether the number is within the bound; one that is no number is not."""
        return self.value <= self.bound


@dataclass(frozen=True)
class Verdict:
    """One row of the stability table.

    stopped: why a run ended before its time, empty if it did not.  seconds: of the steps, without making the program.
    reason: of figures beyond their bounds, empty where none is known. steps and rejected are 0 where nothing runs.
    """

    section: str
    case: str
    about: str
    method: str
    figures: tuple[Figure, ...]
    steps: int = 0
    rejected: int = 0
    seconds: float = 0.0
    stopped: str = ""
    reason: str = ""

    @property
    def meets(self) -> bool:
        """Whether all figures are within their bounds, of a run that came to its end."""
        return not self.stopped and all([figure.meets for figure in self.figures])

    @property
    def explained(self) -> bool:
        """Whether it meets its bounds or has a reason why not."""
        return self.meets or bool(self.reason)

    @property
    def words(self) -> str:
        """The verdict."""
        return "meets" if self.meets else "limit" if self.reason else "unexplained"

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON: numbers that are not finite as text."""
        figures = [
            {
                "quantity": each.quantity,
                "value": _number(each.value),
                "bound": _number(each.bound),
                "unit": each.unit,
                "why": each.why,
                "meets": each.meets,
            }
            for each in self.figures
        ]
        own = {name: getattr(self, name) for name in ("section", "case", "about", "method")}
        run = {name: getattr(self, name) for name in ("steps", "rejected", "seconds", "stopped")}
        return {**own, "verdict": self.words, "reason": self.reason, **run, "figures": figures}


def _number(value: float) -> float | str:
    return value if abs(value) < float("inf") else str(value)
