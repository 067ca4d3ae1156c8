"""Initial value problems as a caller states them: the start, constant forces, parameter values and times, checked."""

import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, or_nearest, real_array

from ...systems.arguments import parameter_value, per_coordinate
from ...systems.model import Model
from ..constraints.constraints import projected_start
from ..constraints.row_numbers import in_python
from ..state_equation import normalization, state_inputs

PAST = 1e-14  # of the end: some roundings, by which a last time may lie past it


class InitialValues(NamedTuple):
    """Starts of N motions, and the other inputs of their state equation: one number for all, or one for each."""

    x: Array  # (N, m): q, normalized, and then qd, or the states of an OdeSystem
    states: tuple[str, ...]  # names of x
    bound: dict[str, float]  # tau0.., parameters
    varied: dict[str, Array]  # (N,) each

    def values(self, k: int) -> dict[str, float]:
        """The inputs of motion k."""
        return self.bound | {name: float(column[k]) for name, column in self.varied.items()}


def other_inputs(model: Model, tau: Any = 0.0, parameters: Mapping[str, Any] | None = None) -> dict[str, float]:
    """The numbers of the inputs of a model's state equation besides its states and t.

    tau: constant applied force, for all velocities or for each.  parameters: values in place of the model's own.
    Raises TypeError or ValueError, naming the argument, for another shape or what is not finite.
    """
    return _other_inputs(model, tau, parameters, many=False)[0]


def parameter_values(model: Model, parameters: Mapping[str, float] | None) -> dict[str, float]:
    """Values of all parameters of a model, its own unless given.  Raises as `other_inputs`."""
    return _parameters(model, parameters, many=False)[0]


def given_state(model: Model, q: ArrayLike, qd: ArrayLike | None) -> Array:
    """A state (m,), whether or not it meets the constraints of the model.  Raises as `other_inputs`.

    q, qd: (nq,) and (n,), of a quaternion in q only the direction counts; or the states of an OdeSystem and None.
    """
    return normalized(model, np.concatenate(_state_parts(model, q, qd, many=False)))


def note_start(model: Model, q: ArrayLike, qd: ArrayLike | None, t: float) -> None:
    """The rank of constraints is looked for at this state first."""
    if model.system is not None and len(model.system.constraints):
        x = given_state(model, q, qd)
        model.system.constraints.given[:] = [(x[: model.system.nq], t, model.system.parameters)]


def start_state(model: Model, q: ArrayLike, qd: ArrayLike | None, bound: Mapping[str, float], t: float = 0.0) -> Array:
    """The state (m,) in which a motion starts at t [s], the other inputs as they are `bound`.

    One that does not meet the constraints of a system is moved onto them, with a ConstraintWarning.
    """
    return _met(model, given_state(model, q, qd), bound, t)


def initial_values(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    tau: ArrayLike = 0.0,
    parameters: Mapping[str, ArrayLike] | None = None,
    t: float = 0.0,
    *,
    many: bool = True,
) -> InitialValues:
    """The starts of N motions, see `start_state`. Each of the arguments has one row for all, or one for each.

    many: else one motion, whose arguments have no axis N.
    """
    if not many:
        bound = other_inputs(model, tau, parameters)
        return InitialValues(start_state(model, q, qd, bound, t)[None], state_inputs(model).states, bound, {})
    bound, varied = _other_inputs(model, tau, parameters, many=True)
    parts = _state_parts(model, q, qd, many=True)
    counts = {what: len(array) for what, array in zip(("q", "qd"), parts, strict=False) if array.ndim == 2}
    applied, states = state_inputs(model).applied, state_inputs(model).states
    if varied.keys() & {*applied}:
        counts["tau"] = len(varied[applied[0]])
    counts |= {f"parameter {name!r}": len(varied[name]) for name in varied if name not in applied}
    count = _one_count(counts)
    x = normalized(model, np.concatenate([np.broadcast_to(part, (count, part.shape[-1])) for part in parts], axis=-1))
    start = InitialValues(x, states, bound, varied)
    if model.system is None or not len(model.system.constraints):
        return start
    return start._replace(x=np.array([_met(model, row, start.values(k), t) for k, row in enumerate(x)]))


def _met(model: Model, x: Array, values: Mapping[str, float], t: float) -> Array:
    """The state, moved onto the constraints of the model."""
    system = model.system
    if system is None or not len(system.constraints):
        return x
    return projected_start(system, x, t, {name: values[name] for name in system.parameters})


def _other_inputs(
    model: Model, tau: Any, parameters: Mapping[str, Any] | None, *, many: bool
) -> tuple[dict[str, float], dict[str, Array]]:
    """Inputs besides states and t that are the same for all motions, and columns, (N,), of those that are not."""
    inputs, system = state_inputs(model), model.system
    bound, varied = _parameters(model, parameters, many=many)
    if system is None:
        if np.any(real_array("tau", tau)):
            raise ValueError(f"tau must be 0 for a system of first order, which no force acts on, got {tau!r:.60}")
        return bound, varied
    if many and (tau := real_array("tau", tau)).ndim == 2:
        columns = _rows("tau", tau, len(inputs.applied), "velocity", many=many).T
        return bound, dict(zip(inputs.applied, columns, strict=True)) | varied
    forces = per_coordinate("tau", tau.tolist() if isinstance(tau, np.ndarray) else tau, model.velocities)
    return dict(zip(inputs.applied, forces, strict=True)) | bound, varied


def _state_parts(model: Model, q: ArrayLike, qd: ArrayLike | None, *, many: bool) -> list[Array]:
    """q and qd, each (n,) or, of many motions, also (N, n); of a system of first order q alone."""
    nq, n = len(model.coordinates), len(model.velocities)
    if model.system is None:
        if qd is not None:
            raise ValueError("qd must be None for a system of first order; q holds its whole state")
        return [_rows("q", q, nq, "state", many=many)]
    velocity = "coordinate" if n == nq else "velocity"
    return [_rows("q", q, nq, "coordinate", many=many), _rows("qd", qd, n, velocity, many=many)]


def normalized(model: Model, x: Array) -> Array:
    """States (.., m) with the constraint of the coordinates met, such as quaternions of length 1.

    Raises ValueError where there are no such, as of a quaternion of length 0.
    """
    graph = normalization(model)
    if graph is None:
        return x
    if x.ndim == 1:
        one = in_python(graph)
        result = one(one(x))  # of a length that is far from 1, the first time is rounded
    else:
        columns = list(np.moveaxis(x, -1, 0))
        with np.errstate(all="ignore"):
            for _ in range(2):
                columns = list(graph.evaluate(dict(zip(graph.input_names, columns, strict=True))).values())
        result = np.stack(np.broadcast_arrays(*columns), axis=-1)
    if not (good := np.isfinite(result)).all():
        *row, _ = np.argwhere(~good)[0].tolist()
        bad = [k for k, fine in enumerate(good[*row]) if not fine]
        names, values = ", ".join([repr(model.coordinates[k]) for k in bad]), x[*row, bad].tolist()
        of = f" of trajectory {row[0]}" if row else ""
        raise ValueError(f"{names} need a length whose square is neither 0 nor beyond float64, got {values}{of}")
    return result


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


def _parameters(
    model: Model, parameters: Mapping[str, Any] | None, *, many: bool
) -> tuple[dict[str, float], dict[str, Array]]:
    """Parameters that are the same for all motions, and columns, (N,), of those that are not."""
    if not isinstance(parameters, Mapping | None):
        raise TypeError(f"parameters must be a mapping of names to numbers, got {parameters!r:.60}")
    chosen, bound, varied = dict(parameters or {}), dict(model.parameters), dict[str, Array]()
    if unknown := [str(name) for name in chosen if name not in bound]:
        known = or_nearest(unknown[0], list(bound))
        raise ValueError(f"the system has no parameter {', '.join(unknown)} ({known})")
    for name, value in chosen.items():
        if many and np.ndim(value):
            varied[name] = _column(name, value)
            del bound[name]
        else:
            bound[name] = parameter_value(name, np.asarray(value).item() if many else value)
    if chosen and model.system is not None:
        model.system.require_values({**bound, **varied})
    return bound, varied


def _rows(what: str, value: ArrayLike | None, n: int, item: str, *, many: bool) -> Array:
    """Numbers for a motion, (n,), or of many also for each, (N, n)."""
    array = None if value is None else real_array(what, value)
    if array is None or array.ndim not in ((1, 2) if many else (1,)) or array.shape[-1] != n:
        needed = f"(N, {n}), or ({n},) for all trajectories" if many else f"({n},), one for each {item}"
        raise ValueError(f"{what} must have shape {needed}, got {None if array is None else array.shape}")
    if not (good := np.isfinite(array)).all():
        if array.ndim == 1:
            raise ValueError(f"{what} must be finite, got {array.tolist()}")
        row, column = np.argwhere(~good)[0].tolist()
        raise ValueError(f"{what} must be finite, got {array[row, column]} at index {column} of trajectory {row}")
    return array


def _column(name: str, value: ArrayLike) -> Array:
    array = real_array(f"parameter {name!r}", value)
    if array.ndim != 1:
        raise ValueError(f"parameter {name!r} must be a number or have shape (N,), got {array.shape}")
    if not (good := np.isfinite(array)).all():
        k = int(np.argmin(good))
        raise ValueError(f"parameter {name!r} must be finite, got {array[k]} for trajectory {k}")
    return array


def _one_count(counts: Mapping[str, int]) -> int:
    if not counts:
        raise ValueError("how many trajectories: q, qd, tau or a parameter must have a row for each, (N, n) or (N,)")
    if len(set(counts.values())) > 1:
        rows = ", ".join(f"{what} has {count}" for what, count in counts.items())
        raise ValueError(f"q, qd, tau and parameters must have the same number of trajectories, got: {rows}")
    count = next(iter(counts.values()))
    if not count:
        raise ValueError("there must be at least one trajectory, got 0")
    return count
