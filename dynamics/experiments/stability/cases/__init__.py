"""Cases: the rows of the stability table, models with a start, a horizon, what to watch and a bound to meet."""

from __future__ import annotations

from . import chains, extremes, fields, orbits, rotation, stiff
from .case import RTOL, Criterion, StabilityCase

__all__ = ["RTOL", "TABLE", "Criterion", "StabilityCase", "load", "names"]

TABLE: dict[str, StabilityCase] = {
    case.name: case for rows in (stiff, chains, orbits, rotation, fields, extremes) for case in rows.cases()
}


def names() -> list[str]:
    """Names of the cases."""
    return list(TABLE)


def load(name: str) -> StabilityCase:
    """The case of that name. Raises ValueError for a name that is not among `names()`."""
    if name not in TABLE:
        raise ValueError(f"there is no case {name!r}; the cases are {', '.join(TABLE)}")
    return TABLE[name]
