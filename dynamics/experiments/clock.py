"""Clocks: what a run takes by the clock and of the processor, once or in turns with others."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Generic, NamedTuple, TypeVar

Made = TypeVar("Made")


class Spent(NamedTuple, Generic[Made]):
    """Seconds by the clock and of the processor, and what came of them."""

    seconds: float
    processor: float
    made: Made


def spent(run: Callable[[], Made]) -> Spent[Made]:
    """A run, and what it took."""
    worked, begin = time.process_time(), time.perf_counter()
    made = run()
    seconds = time.perf_counter() - begin
    return Spent(seconds, time.process_time() - worked, made)


def in_turns(runs: Mapping[str, Callable[[], Made]], turns: int) -> dict[str, list[Spent[Made]]]:
    """All runs in turns, so that they share the machine's moods."""
    taken: dict[str, list[Spent[Made]]] = {name: [] for name in runs}
    for _ in range(turns):
        for name, run in runs.items():
            taken[name].append(spent(run))
    return taken
