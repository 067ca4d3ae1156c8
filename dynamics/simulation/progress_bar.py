"""A progress line on the terminal for runs that take long."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

QUIET = 1.0  # s: a run shorter than this prints nothing


class Progress:
    """`with Progress("simulate", total=10.0) as progress: progress(3.2)`; show: None asks if it is a terminal."""

    def __init__(
        self, what: str, total: float, show: bool | None = None, clock: Callable[[], float] = time.perf_counter
    ) -> None:
        self.what, self.total, self.clock = what, total, clock
        self.show = sys.stderr.isatty() if show is None else show
        self.start = self.last = clock()
        self.written = False

    def __call__(self, done: float) -> None:
        """Say how far the run is, at most ten times a second."""
        now = self.clock()
        if self.show and now - self.start >= QUIET and now - self.last >= 0.1:
            self.last, self.written = now, True
            share = min(done / self.total, 1.0) if self.total else 1.0
            bar = "#" * int(24 * share)
            sys.stderr.write(f"\r{self.what} [{bar:24}] {share:4.0%}  {now - self.start:.0f} s")
            sys.stderr.flush()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        if self.written:
            sys.stderr.write("\n")
