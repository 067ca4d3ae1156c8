"""Starts: what the trajectories of an ensemble begin with, and what of it varies from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, real_array, require_mapping

from ...equations.initial_value import check_names, normalized, on_constraints
from ...equations.state_equation import state_inputs
from ...systems.arguments import parameter_value, per_coordinate
from ...systems.model import Model, as_ode, as_system


class Starts(NamedTuple):
    """N states, and the other inputs of the state equation: one number for all, or one for each trajectory."""

    x: Array  # (N, m)
    states: tuple[str, ...]  # names of x
    same: dict[str, float]
    varied: dict[str, Array]  # (N,) each


def starts(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    tau: ArrayLike,
    parameters: Mapping[str, ArrayLike] | None,
    t: float = 0.0,
) -> Starts:
    """The starts of an ensemble. Raises ValueError for shapes that do not fit, and for what is not finite."""
    inputs = state_inputs(model)
    n = len(inputs.applied)
    arrays = {"q": _array("q", q, len(inputs.states) - n)}
    if as_ode(model) is None:
        if qd is None:
            raise ValueError(f"qd must have shape (N, {n}) or ({n},), got None")
        arrays["qd"] = _array("qd", qd, n)
    elif qd is not None or np.any(tau):
        raise ValueError("qd must be None and tau 0 for a system of first order; q holds its whole state")
    same: dict[str, float] = dict(inputs.parameters)
    columns: dict[str, Array] = {}
    parameters = {} if parameters is None else require_mapping("parameters", parameters, "name: numbers")
    check_names(inputs, parameters)
    for name, value in parameters.items():
        if np.ndim(value) == 0:
            same[name] = parameter_value(name, np.asarray(value).item())
        else:
            columns[name] = _column(name, value)
            del same[name]
    if parameters and as_ode(model) is None:
        as_system(model).require_values({**same, **columns})
    if real_array("tau", tau).ndim == 2:
        arrays["tau"] = _array("tau", tau, n)
    else:
        values = np.asarray(tau).tolist()
        applied = per_coordinate("tau", values, as_system(model).velocities) if inputs.applied else ()
        same |= zip(inputs.applied, applied, strict=True)
    counts = {what: len(array) for what, array in arrays.items() if array.ndim == 2}
    counts |= {f"parameter {name!r}": len(array) for name, array in columns.items()}
    count = _one_count(counts)
    varied = dict(zip(inputs.applied, arrays.pop("tau").T, strict=True)) if "tau" in arrays else {}
    x = np.concatenate([np.broadcast_to(array, (count, array.shape[-1])) for array in arrays.values()], axis=1)
    x = normalized(model, x)
    if as_ode(model) is None and len(as_system(model).constraints):
        others = [same | {name: float(column[i]) for name, column in columns.items()} for i in range(count)]
        x = np.array([on_constraints(model, row, t, values) for row, values in zip(x, others, strict=True)])
    return Starts(x, inputs.states, same, varied | columns)


def _array(what: str, value: ArrayLike, n: int) -> Array:
    array = real_array(what, value)
    if array.ndim not in (1, 2) or array.shape[-1] != n:
        raise ValueError(f"{what} must have shape (N, {n}), or ({n},) for all trajectories, got {array.shape}")
    if not (good := np.isfinite(array)).all():
        *row, column = np.argwhere(~good)[0].tolist()
        of = f" of trajectory {row[0]}" if row else ""
        raise ValueError(f"{what} must be finite, got {array[*row, column]} at index {column}{of}")
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
