"""Peer and Contender: the base class of other software, and one task made ready to be timed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cgraph.extend import Array

from .case import Case

# How a task is asked for.
MODES = {
    "call": "a call from Python: the call alone, its arguments and its result in the peer's own memory",
    "loop": "an evaluation in a native loop of 1000, each pass on the result of the one before",
    "batch": "a state of a batch of 4096, one core",
}


class UnavailableError(Exception):
    """Why a peer does not do a task of this model, though it has a function for such."""


@dataclass(frozen=True)
class Contender:
    """A way to do a task.

    run: what is timed.  result: what `run` gave -> the values in the order of the task's graph: (n_out,) of a call,
    (n_out, BATCH) of a batch, the carry after the last pass of a loop.
    evaluations: of the task, in one run.  size: instructions or nodes of one evaluation, where they can be counted.
    """

    run: Callable[[], object]
    result: Callable[[Any], Array]
    evaluations: int = 1
    size: int | None = None


class Peer(ABC):
    """One piece of software on one case. Making it raises ImportError when the software is not installed."""

    def __init__(self, case: Case) -> None:
        self.case = case

    @abstractmethod
    def prepare(self, task: str, mode: str) -> Contender:
        """The contender for a task and a mode, compiled. Raises UnavailableError."""
