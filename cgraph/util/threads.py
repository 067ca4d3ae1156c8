"""Work shared among threads."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..core.evaluation import Array


def thread_count(threads: int | None) -> int:
    """The number of threads that an argument `threads` asks for: at least 1; None is one for each core."""
    if threads is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or threads < 1:
        raise ValueError(f"threads must be a whole number from 1, or None for one on each core, got {threads!r}")
    return int(threads)


def share(work: Callable[[int], None], items: Iterable[int], threads: int) -> None:
    """Run `work(item)` for every item, in whichever thread is free; the caller's thread is one of them.

    After an exception, Ctrl-C among them, no thread begins another item; it is raised once all have stopped.
    """
    waiting = deque(items)

    def run() -> None:
        try:
            while waiting:
                try:
                    item = waiting.popleft()
                except IndexError:  # another thread was faster
                    return
                work(item)
        except BaseException:
            waiting.clear()
            raise

    threads = min(threads, len(waiting))
    if threads <= 1:
        run()
        return
    with ThreadPoolExecutor(threads - 1) as pool:  # not kept: threads do not survive a fork
        others = [pool.submit(run) for _ in range(threads - 1)]
        run()
        for other in others:
            other.result()


def write_batch(
    width: int, columns: Callable[[Array, Array], None], points: Array, result: Array, threads: int
) -> None:
    """Results (n_out, N) that `columns` writes for points (n_in, N), in blocks of that width."""

    def block(start: int) -> None:
        stop = start + width
        columns(points[:, start:stop], result[:, start:stop])

    # Blocks begin where they begin whatever `threads` is, so that each column always has the same neighbours.
    total = points.shape[1]
    share(block, range(0, total, width), min(threads, total // width))
