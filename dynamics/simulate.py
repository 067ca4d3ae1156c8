"""Simulation: the motion of a system from a start, as a Trajectory."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg

from .equations import energy, forward_dynamics
from .integrators import METHODS, step
from .progress import Progress
from .system import TIME, System, as_system, parameter_value, per_coordinate

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Stats:
    """How a run went. complete: it reached t_end; if not, `status` says where and why it stopped."""

    method: str
    steps: int
    evaluations: int  # of the forward dynamics
    dt: float  # s, the largest step taken
    seconds: float  # run time of the steps, without building and compiling
    complete: bool
    status: str


@dataclass(frozen=True)
class Trajectory:
    """The motion: t (T,) [s]; q and qd (T, n) [rad or m, per second]; energy (T,) [J]; and how the run went."""

    t: Array
    q: Array
    qd: Array
    energy: Array
    stats: Stats


def simulate(
    model: Any,
    q: ArrayLike,
    qd: ArrayLike,
    t_end: float,
    method: str = "rk4",
    *,
    dt: float = 1e-3,
    t_eval: ArrayLike | None = None,
    tau: float | Sequence[float] = 0.0,
    parameters: Mapping[str, float] | None = None,
    progress: bool | None = None,
) -> Trajectory:
    """The motion of a system from (q, qd) at t = 0 to t_end, by a fixed-step method.

    q, qd: (n,), the start.  t_end [s].  method: "rk4" (order 4) or "euler" (order 1).
    dt [s]: the largest step; between two recorded instants the steps are equal and at most dt, so that the last row is
        at t_end exactly.
    t_eval: increasing times in [0, t_end] to record; by default every step.  tau: constant applied force, for all
        coordinates or for each.  parameters: values in place of the system's own.
    progress: a progress line on standard error; None shows it on a terminal, for runs over a second.

    A step that gives a state that is not finite ends the run: the trajectory keeps what was computed before it and
    `stats.status` names the time and the coordinate. Ctrl-C does the same.
    Raises ValueError for arguments out of range, SingularMassMatrixError for a coordinate without inertia.
    """
    system = as_system(model)
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    state = np.concatenate([_state("q", q, system), _state("qd", qd, system)])
    for what, value in (("t_end", t_end), ("dt", dt)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{what} must be positive and finite, got {value!r} s")
    instants = _instants(t_end, dt, t_eval)
    values = _parameter_values(system, parameters)

    bound = {f"tau{i}": each for i, each in enumerate(per_coordinate("tau", tau, system.n))} | values
    rate = _Rate(system, bound)
    rows = [state]
    steps, largest, status = 0, 0.0, ""
    start = time.perf_counter()
    try:
        with np.errstate(all="ignore"), Progress("simulate", t_end, progress) as report:
            for begin, end in itertools.pairwise(instants):
                count = max(1, math.ceil((end - begin) / dt * (1.0 - 1e-12)))
                size = (end - begin) / count
                for k in range(count):
                    state = step(METHODS[method], rate, begin + k * size, state, size)
                    if not np.isfinite(state).all():
                        status = _stopped(system, begin + (k + 1) * size, state)
                        break
                    steps += 1
                if status:
                    break
                largest = max(largest, min(size, dt))
                rows.append(state)
                report(end)
    except KeyboardInterrupt:
        status = f"interrupted after t = {instants[len(rows) - 1]:.6g} s"
    seconds = time.perf_counter() - start

    table = np.array(rows)
    times = np.array(instants[: len(rows)])
    if t_eval is not None and np.asarray(t_eval).flat[0] > 0.0:  # the start is recorded only when asked for
        table, times = table[1:], times[1:]
    n = system.n
    stats = Stats(method, steps, rate.calls, largest, seconds, not status, status or "reached t_end")
    return Trajectory(times, table[:, :n], table[:, n:], _energies(system, values, times, table), stats)


class _Rate:
    """xdot = (qd, qdd) of the state x = (q, qd), from the compiled forward dynamics."""

    def __init__(self, system: System, bound: Mapping[str, float]) -> None:
        self.graph = cg.specialize(forward_dynamics(system), bound)
        self.values = cg.compile(self.graph).values
        self.n = system.n
        self.timed = TIME in self.graph.input_names
        self.calls = 0

    def __call__(self, t: float, x: Array) -> Array:
        self.calls += 1
        arguments = x.tolist()
        if self.timed:
            arguments.append(t)
        return np.concatenate([x[self.n :], self.values(arguments)])


def _energies(system: System, values: Mapping[str, float], times: Array, table: Array) -> Array:
    graph = cg.specialize(energy(system), values)
    rows = [*table.T] + ([times] if TIME in graph.input_names else [])
    energies: Array = cg.compile(graph).batch(np.array(rows))[0]
    return energies


def _state(what: str, value: ArrayLike, system: System) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (system.n,):
        raise ValueError(f"{what} must have shape ({system.n},), one for each coordinate, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite, got {array.tolist()}")
    return array


def _instants(t_end: float, dt: float, t_eval: ArrayLike | None) -> list[float]:
    if t_eval is None:
        count = max(1, math.ceil(t_end / dt * (1.0 - 1e-12)))
        return [t_end * k / count for k in range(count)] + [float(t_end)]
    times = np.asarray(t_eval, dtype=np.float64)
    listed: list[float] = times.ravel().tolist()
    increasing = all(a < b for a, b in itertools.pairwise(listed))
    if times.ndim != 1 or not listed or not increasing or not (listed[0] >= 0.0 and listed[-1] <= t_end):
        raise ValueError(f"t_eval must be increasing times in [0, t_end = {t_end:g} s]")
    return listed if listed[0] == 0.0 else [0.0, *listed]


def _parameter_values(system: System, parameters: Mapping[str, float] | None) -> dict[str, float]:
    given = dict(parameters or {})
    if unknown := [name for name in given if name not in system.parameters]:
        raise ValueError(
            f"the system has no parameter {', '.join(unknown)} (it has {', '.join(system.parameters) or 'none'})"
        )
    return system.parameters | {name: parameter_value(name, value) for name, value in given.items()}


def _stopped(system: System, t: float, state: Array) -> str:
    index = int(np.flatnonzero(~np.isfinite(state))[0])
    name = system.coordinates[index % system.n]
    what = "coordinate" if index < system.n else "velocity of"
    return f"stopped at t = {t:.6g} s: {what} {name!r} is {state[index]} after the step"
