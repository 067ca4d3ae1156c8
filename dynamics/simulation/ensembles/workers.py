"""Workers: what shares chunks out, among threads of this process, by an executor or by any map."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, ThreadPoolExecutor, wait

import numpy as np

from cgraph._shared import Array, thread_count

from .ensemble import Part
from .task import Chunk, Task

Map = Callable[[Callable[[Chunk], Part], Sequence[Chunk]], Iterable[Part]]
Team = int | Map | Executor  # number of threads, or who does the work
Workers = Team | None
LOOK = 0.1  # s: not every system interrupts a wait without an end for Ctrl-C
MOST_THREADS = 2**31  # threads


def checked(workers: Workers) -> Team:
    """The number of threads, the executor or the map. Raises ValueError for what is none of these."""
    kind: object = workers
    if isinstance(kind, type) and issubclass(kind, Executor):
        name = kind.__name__
        raise ValueError(f"workers must be an executor, and {name} is the class of one: give it {name}()")
    if isinstance(workers, Executor) or callable(workers):
        return workers
    if workers is None:
        return thread_count(None)
    if isinstance(workers, bool) or not isinstance(workers, (int, np.integer)) or not 1 <= workers <= MOST_THREADS:
        raise ValueError(
            "workers must be a whole number from 1, None for one on each core, an executor or a function like map, got "
            f"{workers!r:.40}"
        )
    return thread_count(workers)


def finished(task: Task, chunks: Sequence[Chunk], workers: Team, table: Array) -> Generator[Part, None, None]:
    """The parts as they come, in any order; closing it, or an exception, ends the threads.

    table: (N, T, m), in which this process makes the rows. Those of a map's parts lie elsewhere.

    Raises TypeError for a map that gives something else than results, RuntimeError for a process that was ended.
    """
    if isinstance(workers, int):
        stop = threading.Event()

        def run(chunk: Chunk) -> Part:
            return task.run(chunk, table[chunk.first : chunk.first + len(chunk.x)], stop.is_set)

        if workers == 1:
            yield from map(run, chunks)
            return
        with ThreadPoolExecutor(min(workers, len(chunks))) as pool:  # which waits for its threads at any exit
            try:
                yield from _by_executor(pool, run, chunks)
            finally:
                stop.set()
        return
    done, wanted = 0, "workers must give the results of the function, as map does, got"
    try:
        executor = workers if isinstance(workers, Executor) else getattr(workers, "__self__", None)
        results: object = (
            _by_executor(executor, task, chunks) if isinstance(executor, Executor) else workers(task, chunks)
        )
        if not isinstance(results, Iterable):
            raise TypeError(f"{wanted} {results!r:.60}")
        for part in results:
            if not isinstance(part, Part):
                raise TypeError(f"{wanted} {type(part).__name__}: {part!r:.60}")
            yield part
            done += 1
    except BrokenExecutor:
        came = f"{done} of {len(chunks)} chunks were here"
        ended = f"a process of workers was ended from outside, as where memory runs out, when {came}"
        raise RuntimeError(ended) from None


def _by_executor(pool: Executor, run: Callable[[Chunk], Part], chunks: Sequence[Chunk]) -> Generator[Part, None, None]:
    """The parts as they end, none of which is kept: an executor's own map waits for the first, and holds the others."""
    waiting = {pool.submit(run, chunk) for chunk in chunks}
    try:
        while waiting:
            ended, waiting = wait(waiting, LOOK, FIRST_COMPLETED)
            while ended:
                yield ended.pop().result()
    finally:
        for each in waiting:
            each.cancel()
