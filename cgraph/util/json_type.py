"""JSON: the type of what it can hold, and numbers in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

Json: TypeAlias = bool | int | float | str | Sequence["Json"] | Mapping[str, "Json"] | None


def json_number(value: float | None) -> float | None:
    """The number, None where it is not finite: JSON has no infinity and no NaN."""
    return value if value is not None and math.isfinite(value) else None
