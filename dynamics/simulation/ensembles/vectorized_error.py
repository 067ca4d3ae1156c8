"""Error estimates of trajectories side by side, by second runs of other steps, side by side as well."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cgraph.extend import Array

from ..equal_steps import EqualSteps, equal_steps
from ..error_estimate import Differences, estimates, matches, second_run
from ..run_options import RunOptions
from ..stepping import StoppedError
from .chunk import Chunk, Part
from .vectorized import VectorCode, block_limits, start_memories


def estimate_side_by_side(
    code: VectorCode, chunk: Chunk, part: Part, options: RunOptions, stopped: Callable[[], bool]
) -> None:
    """The errors of the trajectories of a part that have arrived at their end."""
    second, ratio = second_run(equal_steps(options.instants, options.step), code.program.order)
    memories = start_memories(code, chunk)
    differences = Differences(part.rows)
    last = options.row_times[-1]
    for stretch in second:
        if options.direction * (last - stretch.begin) > 0.0:
            _compare(code, memories, stretch, differences, part.rows, options, stopped)
    for k, error in enumerate(estimates(differences, ratio, code.program.components, options)):
        if not part.status[k]:
            part.errors[:, k] = error.largest, error.last
            part.warnings[k] += [error.warning] if error.warning else []


def _compare(
    code: VectorCode,
    memories: Array,
    stretch: EqualSteps,
    differences: Differences,
    rows: Array,
    options: RunOptions,
    stopped: Callable[[], bool],
) -> None:
    """Make the steps of a stretch, and note where they differ from the rows at the same times."""
    runner, m = code.one_pass, code.program.size
    for name, value in (("start", stretch.begin), ("t", stretch.begin), ("count", 0.0), ("h", stretch.h)):
        runner.write(memories, name, value)
    passes, width = block_limits(code, memories.shape[1])
    most = min(passes, width)
    for done in range(0, stretch.steps, most):
        if stopped():
            raise StoppedError
        record = runner.run_many(memories, min(most, stretch.steps - done)).rows
        times, states = np.ascontiguousarray(record[:, 0, 0]), record[:, 1 : 1 + m].transpose(2, 0, 1)
        differences.seen(states[:, options.direction * (times - options.row_times[-1]) <= 0.0])
        here, there = matches(options.row_times, times)
        differences.add(rows[:, here], states[:, there])
