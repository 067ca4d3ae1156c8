"""Simulation: the motion of a system from a start, as a Trajectory."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import real_array

from ..equations.state_equation import state_inputs
from ..integrators import METHODS, Problem, problem_of
from ..integrators.step_control import RESOLUTION
from ..systems.model import Model
from ..systems.system import TIME, parameter_value, per_coordinate, sequence
from .events import Event, crossings, event_graph
from .free_memory import room
from .progress_bar import Progress
from .recorder import Rows, from_start, recorded_times
from .run_options import limits_of, step_count
from .scipy_solvers import ScipyRun, solver_of
from .stepping import AdaptiveRun, FixedRun, Hermite, Piece, Tally
from .trajectory import Array, Crossings, Stats, Trajectory

DT = 1e-3  # s, the step of methods of equal steps
TABLES = 3  # that the rows are in at most at once, while they are put together
BLOCK = 4096  # rows whose energy is taken at once


def simulate(
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
    events: Event | Iterable[Event] = (),
    tau: float | Sequence[float] = 0.0,
    parameters: Mapping[str, float] | None = None,
    first_step: float | None = None,
    max_steps: float = math.inf,
    backend: str = "auto",
    progress: bool | None = None,
) -> Trajectory:
    """The motion of a system from (q, qd) at t = 0 to t_end.

    q, qd: (n,), the start; of an OdeSystem q is the state, and qd None.  t_end [s].
    method: of equal steps "euler", "rk4", and, symplectic, "symplectic_euler", "verlet", "midpoint", "gauss4",
        "gauss6"; of steps chosen by error "dopri5" and "dop853", and for stiff systems "rodas" and "radau"; with SciPy
        "scipy:Radau", "scipy:BDF", "scipy:LSODA", "scipy:DOP853", "scipy:RK45".
    dt [s]: the largest step. With equal steps (1e-3 by default) the steps between two recorded instants are equal and
        at most dt, so that the last row is at t_end exactly. Chosen steps have no limit by default.
    rtol, atol: the error of a chosen step, relative to each component of the state, and absolute: one number for all,
        or one for each component, (2 n,) of q and then qd.
    t_eval: increasing times in [0, t_end] to record; by default every step. Chosen steps are not changed by it.
    events: instants to find on the way, see `Event`.
    tau: constant applied force, for all coordinates or for each.  parameters: values in place of the system's own.
    first_step [s]: in place of the one that the method chooses.  max_steps: after which the run stops.
    backend: "llvm", "python", or "auto" for machine code where llvmlite is installed; the steps are the same.
    progress: a progress line on standard error; None shows it on a terminal, for runs over a second.

    A step that gives a state that is not finite, or has to be smaller than the resolution of t, ends the run: the
    trajectory keeps what was computed before it and `stats.message` names the time and the coordinate. Ctrl-C does the
    same.
    Raises ValueError for arguments out of range, SingularMassMatrixError for a coordinate without inertia.
    """
    if not isinstance(method, str):
        raise TypeError(f"method must be one of {', '.join(METHODS)} or scipy:..., got {method!r:.60}")
    solver = solver_of(method)
    if solver is None and method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)} or scipy:..., got {method!r}")
    inputs = state_inputs(model)
    limits = limits_of(inputs.states, t_end, dt, first_step, rtol, atol, max_steps)
    values = _parameter_values(inputs.parameters, parameters)
    n = len(inputs.applied)
    bound = {f"tau{i}": each for i, each in enumerate(per_coordinate("tau", tau, model.coordinates))} if n else {}
    problem = problem_of(model, bound | values)
    state = _start(problem, q, qd)
    wanted = (events,) if isinstance(events, Event) else tuple(sequence("events must be", events))
    if other := [each for each in wanted if not isinstance(each, Event)]:
        raise TypeError(f"events must be of the type Event, got {type(other[0]).__name__}: {other[0]!r:.60}")
    asked = None if t_eval is None else recorded_times(t_eval, t_end)

    run: Tally
    if solver is not None:
        run = ScipyRun(problem, solver, backend, limits, asked=asked)
    elif METHODS[method].adaptive:
        dense = bool(wanted) or asked is not None
        run = AdaptiveRun(problem, METHODS[method], (), backend, limits, dense=dense)
    else:
        size = DT if dt is None else dt
        instants = [0.0, float(t_end)] if asked is None else from_start(asked)
        each = asked is None or bool(wanted)
        _check_steps(t_end, size, problem.size if asked is None else 0)
        run = FixedRun(problem, METHODS[method], (), backend, instants=instants, dt=size, each=each, most=max_steps)
    rows, most = Rows(state, asked), room() / TABLES
    watch = _Watch(problem, wanted)
    begin = time.perf_counter()
    try:
        with np.errstate(all="ignore"), Progress("simulate", t_end, progress) as report:
            for piece in run.pieces(state):
                ended = watch(piece)
                rows.add(piece if ended is None else _until(*ended))
                if rows.size > most:
                    run.status = f"stopped at t = {rows.last:.6g} s: the rows fill the memory; t_eval records fewer"
                    break
                if ended is not None:
                    run.status = watch.status
                    break
                report(float(piece.t[-1]))
    except KeyboardInterrupt:
        run.status = f"interrupted after t = {rows.last:.6g} s"
    seconds = time.perf_counter() - begin

    times, table = rows.table()
    stats = Stats(
        method,
        run.steps,
        run.rejected,
        run.evaluations,
        run.largest,
        seconds,
        not run.status,
        run.status or "reached t_end",
    )
    half = n or problem.size
    return Trajectory(
        times, table[:, :half], table[:, half:], _energies(problem, times, table), stats, watch.found(half)
    )


class _Watch:
    """The events of a run: where they happened so far, and whether one ends it."""

    def __init__(self, problem: Problem, events: Sequence[Event]) -> None:
        self.problem, self.events = problem, events
        self.status = ""
        self._found: list[tuple[int, float, Array]] = []
        if events:
            graph = event_graph(events, problem)
            self._graph = graph

    def __call__(self, piece: Piece) -> tuple[Piece, float, Array] | None:
        """Note the events of these steps. The one that ends the run: the steps with dense output, time and state."""
        if not self.events:
            return None
        if piece.dense is None:
            piece = Hermite(self.problem, ()).of(piece)
        for number, t, x in crossings(self._values, self.events, piece):
            self._found.append((number, t, x))
            if self.events[number].terminal:
                self.status = f"event {self.events[number].name!r} at t = {t:.6g} s"
                return piece, t, x
        return None

    def _values(self, t: Array, x: Array) -> Array:
        given = dict(zip(self._graph.input_names, [*x.T, t], strict=True))
        return np.array([np.broadcast_to(each, t.shape) for each in self._graph.evaluate(given).values()])

    def found(self, half: int) -> dict[str, Crossings]:
        """What is in the trajectory."""
        result = {}
        for number, event in enumerate(self.events):
            mine = [(t, x) for k, t, x in self._found if k == number]
            states = np.array([x for _, x in mine]).reshape(len(mine), self.problem.size)
            result[event.name] = Crossings(np.array([t for t, _ in mine]), states[:, :half], states[:, half:])
        return result


def _check_steps(t_end: float, dt: float, m: int) -> None:
    """Raises ValueError for steps that do not move the time, MemoryError where rows of m numbers have no place."""
    if dt < RESOLUTION * t_end:
        raise ValueError(f"dt = {dt:g} s is below the resolution of the time at t_end = {t_end:g} s")
    size, free = 8 * TABLES * step_count(t_end, dt) * m, room()
    if size > free:
        raise MemoryError(
            f"{step_count(t_end, dt)} steps of {m} numbers take {size / 2**30:.3g} GiB, and {free / 2**30:.3g} GiB are "
            "free: record fewer times (t_eval)"
        )


def _until(piece: Piece, t: float, x: Array) -> Piece:
    """The steps up to an instant inside one, which becomes the last."""
    keep = int(np.searchsorted(piece.t, t)) + 1
    cut = Piece(*[None if each is None else each[:keep].copy() for each in piece])  # type: ignore[arg-type]
    cut.t[-1], cut.x[-1] = t, x
    return cut


def _energies(problem: Problem, times: Array, table: Array) -> Array:
    """The energy at each row; NaN for a system of first order."""
    result = np.full(len(times), math.nan)
    if problem.energy is None:
        return result
    for start in range(0, len(times), BLOCK):
        part = slice(start, start + BLOCK)
        given: dict[str, Any] = dict(zip(problem.states, table[part].T, strict=True))
        result[part] = problem.energy.evaluate(given | {TIME: times[part]})["E"]
    return result


def _start(problem: Problem, q: ArrayLike, qd: ArrayLike | None) -> Array:
    system = problem.system
    if system is None:
        if qd is not None:
            raise ValueError("qd must be None for a system of first order; q holds its whole state")
        return _state("q", q, problem.size, "state")
    if qd is None:
        raise ValueError(f"qd must have shape ({system.n},), one for each coordinate, got None")
    return np.concatenate([_state("q", q, system.n, "coordinate"), _state("qd", qd, system.n, "coordinate")])


def _state(what: str, value: ArrayLike, n: int, each: str) -> Array:
    array = real_array(what, value)
    if array.shape != (n,):
        raise ValueError(f"{what} must have shape ({n},), one for each {each}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite, got {array.tolist()}")
    return array


def _parameter_values(own: Mapping[str, float], parameters: Mapping[str, float] | None) -> dict[str, float]:
    if not isinstance(parameters, Mapping | None):
        raise TypeError(f"parameters must be a mapping of names to numbers, got {parameters!r:.60}")
    given = dict(parameters or {})
    if unknown := [name for name in given if name not in own]:
        raise ValueError(f"the system has no parameter {', '.join(unknown)} (it has {', '.join(own) or 'none'})")
    return dict(own) | {name: parameter_value(name, value) for name, value in given.items()}
