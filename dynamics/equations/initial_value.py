"""Initial value problems as a caller states them: the start, constant forces, parameter values and times, checked."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, real_array

from ..systems.arguments import parameter_value, per_coordinate
from ..systems.model import Model, as_ode, as_system
from .projection import projected_start
from .state_equation import StateInputs, normalization, state_inputs

PAST = 1e-14  # of the end: some roundings, by which a last time may lie past it


class InitialValue(NamedTuple):
    """Where a motion starts, and the numbers of every other input of its state equation."""

    x: Array  # (m,): q, normalized, and then qd, or the states of an OdeSystem
    states: tuple[str, ...]  # names of x
    bound: dict[str, float]  # tau0.., parameters


def initial_value(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    tau: float | Sequence[float] = 0.0,
    parameters: Mapping[str, float] | None = None,
    t: float = 0.0,
) -> InitialValue:
    """The start of a model's motion.

    q, qd: (nq,) and (n,), or the states of an OdeSystem and None; of a quaternion in q only the direction counts.
    tau: constant applied force, for all velocities or for each.  parameters: values in place of the model's own.
    t: when [s]. A start that does not meet the constraints of a system is moved onto them, with a ConstraintWarning.

    Raises TypeError or ValueError, naming the argument, for another shape or what is not finite.
    """
    start = given_start(model, q, qd, tau, parameters)
    return start._replace(x=on_constraints(model, start.x, t, start.bound))


def given_start(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    tau: float | Sequence[float] = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> InitialValue:
    """The start as it is given, whether or not it meets the constraints of the model."""
    inputs = state_inputs(model)
    values = _parameters(inputs, parameters)
    if parameters and as_ode(model) is None:
        as_system(model).require_values(values)
    if inputs.applied:
        applied = per_coordinate("tau", tau, as_system(model).velocities)
        values = dict(zip(inputs.applied, applied, strict=True)) | values
    elif np.any(real_array("tau", tau)):
        raise ValueError(f"tau must be 0 for a system of first order, which no force acts on, got {tau!r:.60}")
    return InitialValue(_state(model, inputs, q, qd), inputs.states, values)


def normalized(model: Model, x: Array) -> Array:
    """States (.., m) with the constraint of the coordinates met, such as quaternions of length 1.

    Raises ValueError where there are no such, as of a quaternion of length 0.
    """
    graph = normalization(model)
    if graph is None:
        return x
    columns = list(np.moveaxis(x, -1, 0))
    with np.errstate(all="ignore"):
        for _ in range(2):  # of a length that is far from 1, the first time is rounded
            columns = list(graph.evaluate(dict(zip(graph.input_names, columns, strict=True))).values())
    result = np.stack(np.broadcast_arrays(*columns), axis=-1)
    if not (good := np.isfinite(result)).all():
        *row, _ = np.argwhere(~good)[0].tolist()
        bad = [k for k, fine in enumerate(good[*row]) if not fine]
        names, values = ", ".join([repr(model.coordinates[k]) for k in bad]), x[*row, bad].tolist()
        of = f" of trajectory {row[0]}" if row else ""
        raise ValueError(f"{names} need a length whose square is neither 0 nor beyond float64, got {values}{of}")
    return result


def on_constraints(model: Model, x: Array, t: float, values: Mapping[str, float]) -> Array:
    """A state (m,) that meets the constraints of a model, near to x. Warns where it is another."""
    if as_ode(model) is not None:
        return x
    system = as_system(model)
    return projected_start(system, x, t, {name: values[name] for name in system.parameters})


def check_names(inputs: StateInputs, names: Iterable[str]) -> None:
    """Raises ValueError for a name that is no parameter."""
    if unknown := [str(name) for name in names if name not in inputs.parameters]:
        has = ", ".join(inputs.parameters) or "none"
        raise ValueError(f"the system has no parameter {', '.join(unknown)} (it has {has})")


def times_to_record(t_eval: ArrayLike, t_end: float = math.inf, t0: float = 0.0) -> Array:
    """The times to record, (T,). A last one past t_end by rounding, as that of 0.1 * np.arange(4), becomes t_end.

    Raises ValueError unless they go from t0 towards t_end, increasing, or decreasing where t_end < t0, and lie between.
    """
    times = real_array("t_eval", t_eval).copy()
    direction, sense = (-1.0, "decreasing") if t_end < t0 else (1.0, "increasing")
    span = f"in [{t0:g}, t_end = {t_end:g} s]" if math.isfinite(t_end) else f"from {t0:g} s on"
    needed = f"t_eval must be {sense} times {span}"
    if times.ndim != 1 or not len(times):
        raise ValueError(f"{needed}, got shape {times.shape}")
    if 0.0 < direction * (times[-1] - t_end) <= PAST * max(abs(t0), abs(t_end)):
        times[-1] = t_end
    listed: list[float] = times.tolist()
    low, high = min(t0, t_end), max(t0, t_end)
    outside = [t for t in listed if not (low <= t <= high and math.isfinite(t))]
    if outside:
        raise ValueError(f"{needed}, got {outside[0]!r}")
    if order := [pair for pair in itertools.pairwise(listed) if not direction * pair[0] < direction * pair[1]]:
        raise ValueError(f"{needed}, got {order[0][0]!r} before {order[0][1]!r}")
    return times


def _parameters(inputs: StateInputs, parameters: Mapping[str, float] | None) -> dict[str, float]:
    if not isinstance(parameters, Mapping | None):
        raise TypeError(f"parameters must be a mapping of names to numbers, got {parameters!r:.60}")
    chosen = dict(parameters or {})
    check_names(inputs, chosen)
    return inputs.parameters | {name: parameter_value(name, value) for name, value in chosen.items()}


def _state(model: Model, inputs: StateInputs, q: ArrayLike, qd: ArrayLike | None) -> Array:
    if as_ode(model) is not None:
        if qd is not None:
            raise ValueError("qd must be None for a system of first order; q holds its whole state")
        return _row("q", q, len(inputs.states), "state")
    n = len(inputs.applied)
    nq = len(inputs.states) - n
    item = "coordinate" if n == nq else "velocity"
    if qd is None:
        raise ValueError(f"qd must have shape ({n},), one for each {item}, got None")
    return normalized(model, np.concatenate([_row("q", q, nq, "coordinate"), _row("qd", qd, n, item)]))


def _row(what: str, value: ArrayLike, n: int, item: str) -> Array:
    array = real_array(what, value)
    if array.shape != (n,):
        raise ValueError(f"{what} must have shape ({n},), one for each {item}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} must be finite, got {array.tolist()}")
    return array
