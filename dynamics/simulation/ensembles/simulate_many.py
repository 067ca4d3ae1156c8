"""Simulation of many trajectories of one model, from many starts or with many parameters, as an Ensemble."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Node
from cgraph._shared import Array, require_path, require_whole

from ...equations.state_equation import FORMS
from ...equations.states.initial_value import initial_values
from ...integrators import derive, in_form
from ...integrators.rate_in_modes import switched
from ...systems.model import Model
from ..applied_force import SampledController, with_applied
from ..events.event import Event, as_events, event_program
from ..outcome import Progress, split_crossings, unreached_momenta
from ..run_options import METHOD, Options, Span, Steps, known_options, require_room, time_span
from ..steps.equal_steps import step_count
from ..steps.row_values import converted
from ..trajectory import SimulationWarning
from .ensemble import Ensemble, Part, doubts
from .store import Store, sweep_of
from .task import Chunk, Task, Team, Workers, parts_of, team_of


class ManyOptions(Options, total=False):
    """Keywords of many runs."""

    chunk: int | None


def simulate_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str = METHOD,
    *,
    t_eval: ArrayLike | None = None,
    events: Event | Iterable[Event] = (),
    tau: ArrayLike | Callable[..., Sequence[Node | float]] = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    workers: Workers = 1,
    store: str | os.PathLike[str] | None = None,
    **options: Unpack[ManyOptions],
) -> Ensemble:
    """The motions of a system from N starts at t0 to t_end, by one program that is compiled once.

    Trajectories run side by side, a vector of them at a time; one by one without machine code, with events or, in
    chosen steps, constraints, and where there are few. One whose state is not finite is NaN from there on,
    `stats.message` and a `SimulationWarning` say when and why, and the others go on. Ctrl-C is a KeyboardInterrupt.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The starts, (N, nq) and (N, n) [rad or m, per second], or (nq,) and (n,) for all, as in `simulate`; of an
        OdeSystem q is the state, and qd None.
    t_end, method
        As in `simulate`.
    t_eval : array_like, optional
        Times from t0 to t_end to record, in this order, (T,) [s]; by default every step. Methods that choose their
        steps need it.
    events : Event or iterable of Event
        As in `simulate`. A trajectory that one ends is NaN from there on, and its `stats.status` is 1.
    tau : float, array_like or callable
        Constant applied force [N m or N], for all velocities, for each, (n,), or for each trajectory too, (N, n); or a
        controller in closed form, see `with_controller`, but no `SampledController`.
    parameters : mapping, optional
        {name: value} in place of the model's own, and of those of a controller: for each trajectory, (N,), or a number
        for all, which is built into the machine code, so that another one compiles anew.
    workers : int, Executor, callable or None
        How many threads share the work, None for one on each core; or an executor of `concurrent.futures`, such as
        Dask's `client.get_executor()`; or any map, `workers(function, iterable)`. The bits are the same.
    store : path, optional
        A folder, empty or not there, in which chunks are kept as they end. The same call again goes on where the first
        was ended, by whatever, and at last reads all from the folder, which one call at a time writes.
    **options
        Those of `dyn.Options` but `dense_output`; and `chunk`, how many trajectories a worker takes at a time: by
        default at most 4096, or 256 one by one or with a `store`. Side by side it is rounded up to multiples of 8.

    Returns
    -------
    Ensemble
        t (T,), q (N, T, nq), qd (N, T, n), and `stats` with an entry for each trajectory. With a store q and qd are
        memory maps of its file, which cannot be written; with `form="momentum"` qd are computed, and in memory.

    Raises
    ------
    TypeError, ValueError
        For arguments of another type, shape or range, each by name, `workers` without results, and a `store` that is
        damaged or keeps another sweep.
    MemoryError
        For a result that would not fit.
    OSError
        For a `store` that cannot be written, has no room, or is being written by another call.
    RuntimeError
        Where a process of `workers` is ended from outside.
    SingularMassMatrixError
        For a coordinate without inertia.

    Examples
    --------
    >>> import dynamics as dyn
    >>> fan = dyn.simulate_many(dyn.planar_arm([1.0], [1.0]), [[0.1], [0.2], [0.3]], [0.0], 1.0, t_eval=[0.5, 1.0])
    >>> fan.q[:, -1, 0].round(4).tolist()
    [-0.077, -0.155, -0.2348]
    """
    # Check
    chunk, form = options.pop("chunk", None), options.pop("form", FORMS[0])
    if chunk is not None:
        require_whole("chunk", chunk, 1)
    force: object = tau
    if isinstance(force, SampledController):
        what = "call simulate for each start, or write the controller in closed form"
        raise TypeError(f"a SampledController may remember what it has seen, and so controls one run: {what}")
    folder = None if store is None else require_path("store", store)
    t0, t_end = time_span(t_end, options.pop("t0", 0.0), options.pop("t_span", None))
    steps = Steps(method, **known_options(options, ["dense_output"]))
    span = Span(t_end, t0=t0, t_eval=t_eval)
    watched, team = as_events(events), team_of(workers)
    applied = with_applied(model, tau, parameters)
    start = initial_values(applied.model, q, qd, applied.constant, parameters, t0)
    steps.check(span, start.states)
    if span.times is None and steps.adaptive:
        how = "t_eval must say which times to record, or method='rk4' make equal steps"
        raise ValueError(f"{method!r} chooses the steps of each trajectory: {how}")
    if folder is None:
        count = step_count(span.length, steps.step) + 1 if span.times is None else len(span.times)
        what = f"{len(start.x)} trajectories of {count} rows of {start.x.shape[1]} numbers"
        require_room(8 * count * start.x.size, what, "record fewer times (t_eval), simulate fewer or name a store")

    # Derive the equations as graphs, and write the steps of the method over them
    begin, by_rows = time.perf_counter(), steps.integrator.by_rows
    problem = switched(in_form(derive(applied.model, start.bound, by_rows=by_rows), form))
    watch, nq = event_program(problem, watched), problem.nq

    # Integrate, by whoever takes the chunks and compiles the steps
    span = replace(span, t_eval=steps.row_times(span)) if watched else span
    dense = bool(watched) or span.has_inner_times
    task = Task(problem, steps, span, len(start.x), watch if watched else None, dense=dense)
    p = np.array([start.varied[name] for name in problem.given]).reshape(-1, len(start.x)).T.copy()
    x = converted(problem.momentum, t0, start.x, p)
    width, shape = task.width(chunk, team, stored=folder is not None), (len(x), task.count, x.shape[1])
    if folder is None:
        whole = _run_chunks(task, x, p, width, team)
    else:
        with closing(Store(folder, sweep_of(problem, task, x, p), width, shape)) as kept:
            whole = _run_chunks(task, x, p, kept.width, team, kept)

    # Put the result together
    times, rows = task.times, whole.rows
    logs = [split_crossings(watch, log, nq, p[k]) for k, log in enumerate(whole.columns["happened"]) if watched]
    for k in range(len(x)) if problem.missing is not None else ():
        missed = unreached_momenta(problem, times, rows[k], p[k], start=(t0, start.x[k], x[k]))
        whole.columns["warnings"][k] += tuple(missed)
    stats = whole.stats(method, time.perf_counter() - begin)
    for text in doubts(stats):
        warnings.warn(text, SimulationWarning, stacklevel=2)
    return Ensemble(
        times,
        rows[:, :, :nq],
        converted(problem.velocities, times, rows, p[:, None])[:, :, nq:],
        stats,
        {event.name: tuple([named[event.name] for named in logs]) for event in watch.events},
        rows[:, :, nq:] if problem.momenta else None,
        start.x[:, :nq],
        start.x[:, nq:],
        start.varied,
        problem.model.coordinates,
        problem.model.velocities,
    )


def ends_of(task: Task, x: Array, p: Array, workers: Workers) -> Array:
    """The last rows (N, m) of motions from states x (N, m) with parameters p (N, ..); NaN, with a warning, of some."""
    team, rows = team_of(workers), np.empty((len(x), 1, x.shape[1]))
    with np.errstate(all="ignore"):
        found = task.run_lanes(x, p, rows, lambda: False) if team == 1 and len(x) <= task.largest else None
    if found is not None and found[0].all() and not any(found[1].get("warnings", ())):
        return rows[:, 0]
    whole = _run_chunks(task, x, p, task.width(None, team), team)
    for text in doubts(whole.stats(task.options.method, 0.0)):
        warnings.warn(text, SimulationWarning, stacklevel=3)
    return whole.rows[:, 0]


def _run_chunks(task: Task, x: Array, p: Array, width: int, workers: Team, store: Store | None = None) -> Part:
    """Run the chunks that a store has not, by whoever shares them. Raises ValueError unless all parts come."""
    whole = Part(0, np.empty((len(x), task.count, x.shape[1])) if store is None else store.rows)
    left = {k: Chunk(k, x[k : k + width], p[k : k + width]) for k in range(0, len(x), width)}
    if store is None and len(left) == 1 and isinstance(workers, int):
        return task.run(left[0], whole.rows, lambda: False)
    if store is not None:
        for known in [part for chunk in left.values() if (part := store.part(chunk)) is not None]:
            whole.place(known)
            del left[known.first]
        if left:
            store.lock()

    def done() -> int:
        return len(x) - sum([len(chunk.x) for chunk in left.values()])

    with (
        Progress("simulate", len(x), task.options.progress) as report,
        closing(parts_of(task, [*left.values()], workers, whole.rows)) as parts,
    ):
        for part in parts:
            whole.place(part)
            if store is not None:
                store.keep(part)
            left.pop(part.first, None)
            report(done())
    if left:
        back = f"of {len(x)} trajectories came back {done()}"
        raise ValueError(f"workers must give a result for each item, as map does: {back}")
    if store is not None:
        whole.rows.flags.writeable = False
    return whole
