"""Error estimates of trajectories side by side, by second runs of other steps, side by side as well."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from ..equal_steps import EqualSteps, equal_steps
from ..error_estimate import Differences, estimates, matches, second_run
from ..run_options import RunOptions
from ..stepping import StoppedError
from .chunk import Chunk, Part
from .vectorized import VectorCode, block_limits, start_memories

SAMPLES = 64  # states of a stretch, at least, that tell the size of a motion


class _Course(NamedTuple):
    """What the first runs came to: times (T,) and states (k, T, m)."""

    times: Array
    states: Array


def estimate_side_by_side(
    code: VectorCode, chunk: Chunk, part: Part, ends: Array, options: RunOptions, stopped: Callable[[], bool]
) -> None:
    """The errors of the trajectories of a part that have arrived at their ends (k, m)."""
    times, states = options.row_times, part.rows
    if times[-1] != options.t_end:
        times, states = np.append(times, options.t_end), np.concatenate([states, ends[:, None]], axis=1)
    second, ratio = second_run(equal_steps(options.instants, options.step), code.program.order)
    memories, differences = start_memories(code, chunk), Differences(states, code.program)
    for stretch in second:
        _compare(code, memories, stretch, differences, _Course(times, states), stopped)
    for k, error in enumerate(estimates(differences, ratio, code.program.components, options)):
        if not part.status[k]:
            part.errors[:, k] = error.largest, error.last
            part.warnings[k] += [error.warning] if error.warning else []


def _compare(
    code: VectorCode,
    memories: Array,
    stretch: EqualSteps,
    differences: Differences,
    first: _Course,
    stopped: Callable[[], bool],
) -> None:
    """Make the steps of a stretch, and note where they differ from the first runs at the same times."""
    runner, m = code.one_pass, code.program.size
    for name, value in (("start", stretch.begin), ("t", stretch.begin), ("count", 0.0), ("h", stretch.h)):
        runner.write(memories, name, value)
    every = _every(stretch, first.times)
    passes, width = block_limits(code, memories.shape[1])
    most = max(1, min(passes // every, width)) * every
    for done in range(0, stretch.steps, most):
        if stopped():
            raise StoppedError
        record = runner.run_many(memories, min(most, stretch.steps - done), every).rows
        times, states = np.ascontiguousarray(record[:, 0, 0]), record[:, 1 : 1 + m].transpose(2, 0, 1)
        here, there = matches(first.times, times)
        if len(there) < len(times):
            differences.seen(states)
        differences.add(first.states[:, here], states[:, there])


def _every(stretch: EqualSteps, times: Array) -> int:
    """Of how many steps of a stretch it is enough to see the last, to see it at all of the times and often enough."""
    after = np.rint((times - stretch.begin) / stretch.h).astype(np.int64)
    common = int(np.gcd.reduce(after[(after > 0) & (after <= stretch.steps)], initial=stretch.steps))
    return max(every for every in range(1, max(1, min(stretch.steps // SAMPLES, SAMPLES)) + 1) if common % every == 0)
