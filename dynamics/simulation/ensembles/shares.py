"""Shares: how the trajectories of an ensemble are cut into chunks, run by whoever takes them, and what they warn of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np

from cgraph._shared import Array

from ..progress_bar import Progress
from ..run_options import RunOptions
from ..steps.equal_steps import EqualSteps, even_steps
from ..steps.step_program import StepProgram
from .ensemble import EnsembleStats
from .lanes import fits_lanes, iterates
from .store import Store
from .task import Chunk, Part, Task, not_begun
from .workers import Team, finished

VECTOR = 8  # lanes, or a multiple of them, of every processor: a chunk of trajectories side by side is whole vectors
LARGEST_CHUNK = 256  # trajectories in a chunk, unless asked for
LONGEST_CHUNK = 4096  # of those in lanes, of which a chunk's rows of steps have no more than ..
NUMBERS = 2**22  # .. so many numbers
SHORT = 2**20  # equal steps of all trajectories, which take some hundredths of a second: a chunk for each worker
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together
UNKNOWN = 16  # workers behind a map, which does not say


def side_by_side(program: StepProgram, options: RunOptions, count: int) -> tuple[list[EqualSteps], bool]:
    """The equal steps of trajectories side by side, and whether they go in lanes; neither of what goes one by one."""
    grids = [] if program.adaptive else _grids(program, options, count)
    return grids, fits_lanes(program, options, count) and (program.adaptive or len(grids) == 1)


def _grids(program: StepProgram, options: RunOptions, count: int) -> list[EqualSteps]:
    """Equal steps; empty where trajectories have to go, or are done sooner, one by one."""
    if count < VECTOR and iterates(program):
        return []
    grids = even_steps(options.instants, options.step)
    if options.times is None:  # every step is a row
        grids = [each._replace(rows=each.steps) for each in grids]
    return grids if sum(grid.steps for grid in grids) <= options.max_steps else []


def chunk_width(
    count: int, chunk: int | None, workers: Team, rows: int, grids: Sequence[EqualSteps], *, stored: bool = False
) -> int:
    """Trajectories in a chunk, of so many.

    rows: numbers in the rows of steps that a trajectory keeps in its lane, 0 where it is in none.
    stored: whether a chunk that has not ended is lost when the process is, so that it should be small.
    grids: of trajectories side by side, whose chunks are of whole vectors, so that each has the same neighbors in any.
    """
    largest = min(LONGEST_CHUNK, max(VECTOR, NUMBERS // rows)) if rows else LARGEST_CHUNK
    if chunk is None and stored:
        largest = min(largest, LARGEST_CHUNK)
    if rows and chunk is not None:
        chunk = min(chunk, largest)
    if chunk is None:
        short = rows and grids and count * grids[0].steps <= SHORT
        shares = 1 if short else SHARES
        chunk = min(largest, math.ceil(count / (shares * (workers if isinstance(workers, int) else UNKNOWN))))
    return math.ceil(chunk / VECTOR) * VECTOR if grids else int(chunk)


def run_chunks(task: Task, x: Array, p: Array, width: int, workers: Team, store: Store | None) -> Part:
    """Run the chunks, by whoever shares them, until all parts have come.

    Those that a store has are taken from there, and others are kept there as they end.
    Raises ValueError unless all parts come.
    """
    rows = np.empty((len(x), task.count, x.shape[1])) if store is None else store.rows
    whole, width = not_begun(0, rows, events=task.events is not None), width if store is None else store.width
    chunks = [Chunk(k, x[k : k + width], p[k : k + width]) for k in range(0, len(x), width)]
    arrived = np.zeros(len(whole.rows), dtype=bool)

    def put(part: Part) -> None:
        whole.put(part)
        arrived[part.first : part.first + len(part.rows)] = True

    for chunk in chunks if store is not None else ():
        if store is not None and (part := store.part(chunk)) is not None:
            put(part)
    left = [chunk for chunk in chunks if not arrived[chunk.first]]
    if store is not None and left:
        store.lock()
    try:
        with (
            Progress("simulate", len(arrived), task.options.progress) as report,
            closing(finished(task, left, workers, whole.rows)) as parts,
        ):
            for part in parts:
                put(part)
                if store is not None:
                    store.keep(part)
                report(int(arrived.sum()))
    except KeyboardInterrupt:
        if store is None:
            raise
        raise KeyboardInterrupt(store.kept(int(arrived.sum()))) from None
    if not arrived.all():
        raise ValueError(
            "workers must give a result for each item, as map does: of "
            f"{len(arrived)} trajectories came back {arrived.sum()}"
        )
    return whole if store is None else replace(whole, rows=store.read_only())


def doubts(stats: EnsembleStats) -> list[str]:
    """Warnings of the first trajectory that stopped early and of the first in doubt, with their numbers."""
    early = {k: str(stats.message[k]).removeprefix("stopped ") for k in np.flatnonzero(stats.status < 0).tolist()}
    doubtful = {k: texts[0] for k, texts in enumerate(stats.warnings) if texts} if any(stats.warnings) else {}
    many = f"of {len(stats.warnings)} trajectories"
    said = []
    if early:
        first = min(early)
        said.append(f"{len(early)} {many} stopped early: trajectory {first} {early[first]}")
    if doubtful:
        first = min(doubtful)
        have = "has" if len(doubtful) == 1 else "have"
        said.append(f"{len(doubtful)} {many} {have} a warning: trajectory {first}: {doubtful[first]}")
    return said
