"""Simulation of many trajectories of one model, from many starts or with many parameters, as an Ensemble."""

from __future__ import annotations

import math
import pickle
import time
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...equations.state_equation import state_inputs
from ...integrators import METHODS, Problem
from ...systems.model import Model
from ..free_memory import room
from ..progress_bar import Progress
from ..recorder import from_start, recorded_times
from ..run_options import limits_of, step_count
from ..simulate import DT
from .chunk import Chunk, Part
from .ensemble import Ensemble, EnsembleStats
from .initial_states import starts
from .serialized import portable
from .step_grid import Stretch, stretches
from .task import Task
from .workers import Map, Workers, checked, finished

VECTOR = 8  # lanes, or a multiple of them, of every processor: a chunk of trajectories side by side is whole vectors
LARGEST = 256  # trajectories in a chunk, unless asked for
SHARES = 4  # chunks for each worker, so that workers of unlike speed finish together
UNKNOWN = 16  # workers behind a map, which does not say


def simulate_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float,
    method: str = "rk4",
    *,
    dt: float | None = None,
    rtol: float = 1e-8,
    atol: ArrayLike = 1e-10,
    t_eval: ArrayLike | None = None,
    tau: ArrayLike = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    workers: Workers = 1,
    chunk: int | None = None,
    first_step: float | None = None,
    max_steps: float = math.inf,
    backend: str = "auto",
    progress: bool | None = None,
) -> Ensemble:
    """The motions of a system from N starts at t = 0 to t_end, by one program that is made once.

    q, qd: (N, n), the starts, or (n,) for all; of an OdeSystem q is the state, and qd None.  t_end [s].
    method, dt, rtol, atol, first_step, max_steps, backend: as in `simulate`, without SciPy's methods.
    t_eval: increasing times in [0, t_end] to record; by default every step. Methods that choose their steps need it.
    tau: constant applied force, for all coordinates, for each (n,), or for each trajectory too (N, n).
    parameters: values in place of the system's own, a number for all or one for each trajectory (N,).
    workers: how many threads share the work, None for one on each core; or any map, `workers(function, iterable)`,
        such as that of a pool of processes. The numbers are the same to the last bit.
    chunk: trajectories that a worker takes at a time; by default some chunks for each, of at most 256. Side by side it
        is rounded up to whole vectors, multiples of 8.
    progress: a progress line on standard error; None shows it on a terminal, for runs over a second.

    Where every state takes the same course (euler, rk4; verlet and symplectic_euler of a constant mass matrix and
    forces that do not depend on qd), trajectories run side by side, a vector of them at a time; else one by one.
    One that leaves the numbers is NaN from there on, `stats.message` names the time and the coordinate, and the others
    go on. Ctrl-C keeps the chunks that are done.
    Raises ValueError for arguments out of range or of another shape, MemoryError for a result that would not fit,
    SingularMassMatrixError for a coordinate without inertia, TypeError for `workers` that give no results.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    limits = limits_of(state_inputs(model).states, t_end, dt, first_step, rtol, atol, max_steps)
    if chunk is not None and (not isinstance(chunk, (int, np.integer)) or chunk < 1):
        raise ValueError(f"chunk must be a whole number from 1, got {chunk!r}")
    crew, adaptive = checked(workers), METHODS[method].adaptive
    if adaptive and t_eval is None:
        raise ValueError(f"{method!r} chooses the steps of each trajectory: t_eval must say which times to record")
    x, same, own = starts(model, q, qd, tau, parameters)
    asked = None if t_eval is None else recorded_times(t_eval, t_end)
    size = DT if dt is None else float(dt)
    steps = step_count(t_end, size)
    rows = steps + 1 if asked is None else len(asked)
    taken, free = 8 * len(x) * rows * x.shape[1], room()
    if taken > free:
        raise MemoryError(
            f"{len(x)} trajectories of {rows} rows of {x.shape[1]} numbers take {taken / 2**30:.3g} GiB, and "
            f"{free / 2**30:.3g} GiB are free: record fewer times (t_eval) or simulate fewer at once"
        )

    begin = time.perf_counter()
    problem = Problem(model, same)
    sent = portable(problem, METHODS[method])
    course: list[Stretch] = []
    plan: dict[str, Any]
    if adaptive:
        plan = {"limits": limits}
    else:
        instants = [0.0, float(t_end)] if asked is None else from_start(asked)
        plan = {"instants": instants, "dt": size, "each": asked is None, "most": max_steps}
        course = stretches(instants, size) if asked is not None else [Stretch(0.0, t_end / steps, 1, steps)]
        if sent.straight() is None or sum(each.each * each.rows for each in course) > max_steps:
            course = []
    task = Task(pickle.dumps(sent), backend, asked, rows, plan, tuple(course))
    width = _width(len(x), chunk, crew, whole=bool(course))
    p = np.stack([own[name] for name in problem.parameters], axis=1) if own else x[:, :0]
    chunks = [Chunk(k, x[k : k + width], p[k : k + width]) for k in range(0, len(x), width)]
    result = _Result(len(x), rows, x.shape[1])
    try:
        with (
            Progress("simulate", len(x), progress) as report,
            closing(finished(task, chunks, crew, result.rows)) as parts,
        ):
            for part in parts:
                result.add(part)
                report(int(result.arrived.sum()))
        result.check()
    except KeyboardInterrupt:
        pass
    seconds = time.perf_counter() - begin

    times = asked if asked is not None else np.append(t_end / steps * np.arange(steps), t_end)
    half = len(problem.system.coordinates) if problem.system is not None else problem.size
    stats, table = result.stats(method, seconds), result.rows
    return Ensemble(times, table[:, :, :half], table[:, :, half:], stats)


class _Result:
    """The parts that have come, put together."""

    def __init__(self, count: int, rows: int, m: int) -> None:
        self.rows = np.empty((count, rows, m))
        self.steps, self.rejected, self.evaluations = np.zeros((3, count), dtype=np.int64)
        self.dt, self.status = np.zeros(count), ["interrupted"] * count
        self.arrived = np.zeros(count, dtype=bool)

    def add(self, part: Part) -> None:
        """One more."""
        here = slice(part.first, part.first + len(part.rows))
        if not np.may_share_memory(part.rows, self.rows):  # from another process
            self.rows[here] = part.rows
        for name in ("steps", "rejected", "evaluations", "dt"):
            getattr(self, name)[here] = getattr(part, name)
        self.status[here] = [each or "reached t_end" for each in part.status]
        self.arrived[here] = True

    def check(self) -> None:
        """All parts have come. Raises ValueError otherwise."""
        if not self.arrived.all():
            raise ValueError(
                "workers must give a result for each item, as map does: of "
                f"{len(self.rows)} trajectories came back {self.arrived.sum()}"
            )

    def stats(self, method: str, seconds: float) -> EnsembleStats:
        """How it went."""
        self.rows[~self.arrived] = math.nan
        complete = np.array([each == "reached t_end" for each in self.status])
        return EnsembleStats(
            method, self.steps, self.rejected, self.evaluations, self.dt, seconds, complete, tuple(self.status)
        )


def _width(count: int, chunk: int | None, workers: int | Map, *, whole: bool) -> int:
    """Trajectories in a chunk; whole: of whole vectors, so that each has the same neighbours in any chunk."""
    if chunk is None:
        chunk = min(LARGEST, math.ceil(count / (SHARES * (UNKNOWN if callable(workers) else workers))))
    return math.ceil(chunk / VECTOR) * VECTOR if whole else int(chunk)
