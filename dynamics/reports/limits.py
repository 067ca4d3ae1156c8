"""Limits: the reason of every row of the stability table that is known not to meet its bound."""

from __future__ import annotations

# (section, case, method), where an empty case or method stands for every one: why the bound is not met.
LIMITS: dict[tuple[str, str, str], str] = {}


def reason(section: str, case: str, method: str) -> str:
    """The known reason why a row may be beyond its bound; empty if there is none."""
    for key in ((section, case, method), (section, case, ""), (section, "", method)):
        if key in LIMITS:
            return LIMITS[key]
    return ""
