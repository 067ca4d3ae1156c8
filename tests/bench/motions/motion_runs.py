"""Motions run for their ends alone, one or many, as users of ours and of heyoka run them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from cgraph._shared import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.work_precision.measurement import Outcome, Run
from dynamics.integrators import METHODS
from dynamics.simulation.ensembles.simulate_many import simulate_many
from dynamics.simulation.simulate import prepare
from dynamics.simulation.trajectory import Stats
from tests.bench.motions.trajectory_peers import MOST_STEPS, EndSolver, Heyoka
from tests.bench.peers.heyoka import heyoka

COMPILES = 1e-6  # of the length, in a run that only compiles


def run_to_end(
    task: AccuracyTask, method: str, rtol: float
) -> tuple[Callable[[], Any], Callable[[Any], tuple[Array, Stats]]]:
    """A motion of ours, compiled, and what reads its end and statistics: the one place that says how we are called."""
    motion = prepare(task.model, method, rtol=rtol, progress=False)
    q, qd = np.array(task.q), np.array(task.qd) if task.qd else None
    motion.end(q, qd, COMPILES * task.t_end)

    def read(found: Any) -> tuple[Array, Stats]:
        return np.concatenate([found.q, found.qd]), motion(q, qd, task.t_end, t_eval=[task.t_end]).stats

    return partial(motion.end, q, qd, task.t_end), read


class Motion(EndSolver):
    """One of our methods, called for the end alone."""

    ours = True

    def __init__(self, method: str, task: AccuracyTask, smallest: float) -> None:
        super().__init__(method, task, smallest)
        self.order = METHODS[method].order

    def ready(self, knob: float) -> Run:
        run, end = run_to_end(self.task, self.name, knob)

        def read(found: Any) -> Outcome:
            x, stats = end(found)
            return Outcome(x, stats.steps, stats.rejected, stats.nfev, "" if stats.success else stats.message)

        return Run(run, read=read)


class Many(EndSolver):
    """One of our methods on an ensemble, by `simulate_many` in one thread."""

    ours = True

    def __init__(self, method: str, task: AccuracyTask, starts: Array) -> None:
        super().__init__(method, task, 1.0)
        self.starts = starts

    def ready(self, knob: float) -> Run:
        q, qd = np.split(self.starts, [len(self.task.q)], axis=1)
        velocities = qd if self.task.qd else None
        options: dict[str, Any] = {"rtol": knob, "t_eval": [self.task.t_end], "progress": False}

        def read(found: Any) -> Outcome:
            ends, stats = np.hstack([found.q[:, -1], found.qd[:, -1]]), found.stats
            steps, rejected, evaluations = (int(np.mean(each)) for each in (stats.steps, stats.rejected, stats.nfev))
            status = "" if stats.success.all() else "some stopped before the end"
            return Outcome(ends, steps, rejected, evaluations, status)

        run = partial(simulate_many, self.task.model, q, velocities, method=self.name)
        short = COMPILES * self.task.t_end
        run(t_end=short, **(options | {"t_eval": [short]}))
        return Run(partial(run, t_end=self.task.t_end, **options), read=read)


class HeyokaBatch(EndSolver):
    """heyoka's batch mode on an ensemble: as many motions at once as vectors have lanes, each with its own steps."""

    def __init__(self, task: AccuracyTask, starts: Array, single: Heyoka) -> None:
        self.heyoka, self.system = heyoka(), single.system
        self.lanes = self.heyoka.recommended_simd_size()
        super().__init__("heyoka batch", task, 1.0)
        self.compact, self.starts = single.compact, starts

    def ready(self, knob: float) -> Run:
        lanes = self.lanes
        starts = np.pad(self.starts, ((0, -len(self.starts) % lanes), (0, 0)), "edge")
        blocks = [np.ascontiguousarray(starts[k : k + lanes].T) for k in range(0, len(starts), lanes)]
        options = {"tol": knob, "compact_mode": self.compact}
        integrator = self.heyoka.taylor_adaptive_batch(self.system, blocks[0].copy(), **options)
        ends, counts = np.empty_like(starts), [0] * len(blocks)

        def run() -> list[int]:
            for k, block in enumerate(blocks):
                integrator.set_time(0.0)
                integrator.state[:] = block
                integrator.propagate_until(self.task.t_end, max_steps=MOST_STEPS)
                ends[k * lanes : (k + 1) * lanes] = integrator.state.T
                counts[k] = integrator.propagate_res[0][3]
            return counts

        return Run(run, read=lambda found: Outcome(ends[: len(self.starts)].copy(), int(np.mean(found))))


@dataclass(frozen=True)
class ManyEnds:
    """The median over an ensemble of the largest error of a state, beside the ends of the tightest run."""

    ends: Array  # (N, m)
    size: Array  # (m,)

    def at_end(self, x: Array) -> float:
        return float(np.median(np.max(np.abs(x - self.ends) / self.size, axis=1)))
