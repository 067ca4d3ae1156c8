"""Solutions: where the cases end, to twenty digits, from the file beside this one or computed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...multiprecision import Reference
from ...multiprecision.solution import from_text
from . import cases
from .cases import StabilityCase

if TYPE_CHECKING:
    from cgraph.extend import Json

FILE = Path(__file__).with_name("solutions.json")


def solution(case: StabilityCase) -> Reference | None:
    """The case's motion at its t_end; None for a case without one.

    Kept in a file, as some take a minute to compute, by name, start and t_end. A test computes them again.
    """
    kept = _kept().get(case.name)
    if kept is None or kept["start"] != _hex(case.start) or kept["t"] != case.t_end.hex():
        return case.solution()
    return from_text([case.t_end], [kept["x"]], kept["error"], kept["how"])


def renew(names: Iterable[str] | None = None, say: Callable[[str], None] = lambda line: None) -> None:
    """Compute the solutions of these cases (default: all) and keep them in the file: about a quarter of an hour."""
    entries = dict(_kept())
    for name in cases.names() if names is None else names:
        case = cases.load(name)
        result = case.solution()
        if result is not None:
            entries[name] = entry(case, result)
            say(f"{name}: {result.how}")
    known = [name for name, case in cases.table().items() if name in entries and (case.exact or case.method)]
    ordered = {name: entries[name] for name in known}
    FILE.write_text(json.dumps(ordered, indent=1) + "\n", encoding="utf-8")


def entry(case: StabilityCase, result: Reference) -> dict[str, Json]:
    """What the file says of a case."""
    return {
        "start": _hex(case.start),
        "t": case.t_end.hex(),
        "x": list(result.decimal[0]),
        "error": result.error,
        "how": result.how,
    }


def _hex(values: Iterable[float]) -> list[str]:
    return [float(each).hex() for each in values]


def _kept() -> dict[str, Any]:
    return dict(json.loads(FILE.read_text(encoding="utf-8"))) if FILE.exists() else {}
