"""Values of a model's graphs at states given as arrays, flat or as the matrices and vectors that outputs spell."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike

from cgraph import Compiled, Graph
from cgraph._shared import Array, kept_by_first, real_array, require_kind

from ...systems.arguments import TIME, finite_time
from ...systems.model import Model, as_system
from ...systems.system import System
from ..constraints.constraint_rank import ConstraintWarning, lost_rank
from ..equation import documented
from .initial_value import parameter_values

STATE = ("q", "qd", "qdd", "tau")  # the prefixes of a graph's inputs, each an array of one number a coordinate
State = Mapping[str, ArrayLike | None]
_ENTRY = re.compile(r"(.*?[^\d_])((?:_\d+)+|\d+)")  # M_0_1, h_2, tau0


@documented
def arrays_at(
    model: Model,
    graph: Graph | Compiled,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    qdd: ArrayLike | None = None,
    tau: ArrayLike | None = None,
    *,
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> dict[str, Array]:
    """The outputs of a graph at a state, or at many, as arrays by name: M_0_0, M_0_1, .. are the matrix "M".

    Compiled, a graph is evaluated by machine code, many states side by side in vectors.

    Parameters
    ----------
    graph : Graph or Compiled
        Of the model, such as `mass_matrix(model)`: inputs among q0.., qd0.., qdd0.., tau0.., t and the parameters.
    q : array_like, (nq,) or (N, nq)
        Coordinates [rad or m]; by default 0, quaternions neutral.
    qd, qdd, tau : array_like, (n,) or (N, n)
        Velocities, accelerations, and applied forces [N m or N]; by default 0.

    Returns
    -------
    dict of str to ndarray
        Outputs whose names differ in their indices alone are one array, the others are alone, of the shape (). In
        front of these shapes stands N where there are N states.

    Raises
    ------
    ValueError
        For arrays of another shape, a number that is not finite, an unknown parameter, and a graph of another model.
    TypeError
        For what is no graph, or no model with a Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> dyn.arrays_at(arm, dyn.mass_matrix(arm), q=[0.0, 0.0])["M"].round(12).tolist()
    [[2.666666666667, 0.833333333333], [0.833333333333, 0.333333333333]]
    """
    function, graph = (graph, graph.graph) if isinstance(graph, Compiled) else (None, graph)
    require_kind("graph", graph, Graph, "a Graph, such as mass_matrix(model)")
    system, state = as_system(model), {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    known = {*system.q, *system.qd, *system.qdd, *system.tau, system.t, *system.extra_inputs}
    if unknown := [node.name for node in graph.inputs if node not in known]:
        raise ValueError(f"the graph has the input {unknown[0]!r}, which is no state or parameter of the model")
    if function is None:
        flat = evaluate(system, graph, state, t, parameters)
    else:
        x = input_rows(system, graph.input_names, state, t, parameters)
        flat = function.batch(x.T).T if x.ndim == 2 else function(x)
    _warn_of_lost_rank(system, flat, state, t, parameters)
    arrays: dict[str, Array] = {}
    start = 0
    for name, shape in _shapes(graph):
        end = start + math.prod(shape)
        arrays[name] = flat[..., start:end].reshape((*flat.shape[:-1], *shape))
        start = end
    return arrays


def evaluate(
    model: Model, graph: Graph, state: State, t: float = 0.0, parameters: Mapping[str, float] | None = None
) -> Array:
    """The outputs, (n_out,) or (N, n_out), at a state {"q": .., "qd": .., "qdd": .., "tau": ..}, (n,) or (N, n) each.

    What of the state is None or missing is zero, coordinates neutral. Parameters have the model's values unless given.
    Raises ValueError for another shape, what is not finite, or a parameter that the model does not have.
    """
    rows = input_rows(as_system(model), graph.input_names, state, t, parameters)
    columns = rows.tolist() if rows.ndim == 1 else rows.T
    outputs = graph.evaluate(dict(zip(graph.input_names, columns, strict=True))).values()
    return np.stack([np.broadcast_to(np.asarray(each, dtype=np.float64), rows.shape[:-1]) for each in outputs], axis=-1)


def input_rows(
    system: System, names: Sequence[str], state: State, t: float, parameters: Mapping[str, float] | None
) -> Array:
    """Inputs by their names, (N, n_in), or (n_in,) of one state, which `evaluate` takes likewise."""
    numbers = {TIME: finite_time(t), **parameter_values(system, parameters)}
    arrays, shape = _arrays(system, state)
    rows, place = np.empty((*shape, len(names))), {name: k for k, name in enumerate(names)}
    for name in place.keys() & numbers.keys():
        rows[..., place[name]] = numbers[name]
    for part, array in arrays.items():
        inputs = [place.get(f"{part}{i}") for i in range(array.shape[-1])]
        if inputs and inputs[0] is not None and inputs == [*range(inputs[0], inputs[0] + len(inputs))]:
            rows[..., inputs[0] : inputs[0] + len(inputs)] = array  # as one block
            continue
        for i, k in enumerate(inputs):
            if k is not None:
                rows[..., k] = array[..., i]
    return rows


def _arrays(system: System, state: State) -> tuple[dict[str, Array], tuple[int, ...]]:
    """The parts of a state, checked, (n,) or (N, n) each, and () or (N,)."""
    arrays = {name: _rows(system, name, state.get(name)) for name in STATE}
    shape: tuple[int, ...] = ()
    for name, rows in arrays.items():
        many = rows.shape[:-1]
        if shape in ((), (1,)):
            shape = many or shape
        elif many not in ((), (1,), shape):
            text = f"got {len(rows)} of {name} after {shape[0]}"
            raise ValueError(f"the arrays of a state must have as many rows, or one, {text}")
    return arrays, shape


def _rows(system: System, name: str, values: ArrayLike | None) -> Array:
    """Part of a state, checked: (n,) or (N, n)."""
    known = system.coordinates if name == "q" else system.velocities
    n = len(known)
    if values is None:
        return np.array(system.kinematics.neutral) if name == "q" else np.zeros(n)
    rows = real_array(name, values)
    if rows.ndim not in (1, 2) or rows.shape[-1] != n:
        names = ", ".join(known[:8]) + (", ..." if n > 8 else "")
        raise ValueError(
            f"{name} must have the shape ({n},) or (N, {n}), one number for each of {names}; got {rows.shape}"
        )
    finite = np.isfinite(rows)
    if not np.logical_and.reduce(finite, axis=None):
        at = tuple(np.argwhere(~finite)[0].tolist())
        where = f" in row {at[0]}" if rows.ndim == 2 else ""
        raise ValueError(f"{name} must be finite, got {rows[at]} for {known[at[-1]]!r}{where}")
    return rows


def _warn_of_lost_rank(
    system: System, flat: Array, state: State, t: float, parameters: Mapping[str, float] | None
) -> None:
    """A ConstraintWarning where values are not finite, since rows of constraints follow from others at a state."""
    finite = np.isfinite(flat).all(axis=-1)
    if not len(system.constraints) or finite.all():
        return
    given = system.kinematics.neutral if state["q"] is None else state["q"]
    rows = np.broadcast_to(np.asarray(given, dtype=np.float64), (*finite.shape, system.nq))
    if lost := lost_rank(system.constraints, rows[~finite][0], t, {**system.parameters, **(parameters or {})}):
        where = f" of row {int(np.argmin(finite))}" if finite.ndim else ""
        warnings.warn(f"values{where} are not finite: {lost}", ConstraintWarning, stacklevel=3)


@kept_by_first
def _shapes(graph: Graph) -> list[tuple[str, tuple[int, ...]]]:
    """Name and shape of the arrays that the names of a graph's outputs spell, one after another."""
    arrays: list[tuple[str, tuple[int, ...]]] = []
    for stem, run in groupby(graph.outputs, key=lambda name: _split(name)[0]):
        names = list(run)
        indices = [_split(name)[1] for name in names]
        if len({len(index) for index in indices}) == 1:
            shape = tuple([1 + max(axis) for axis in zip(*indices, strict=True)])
            if list(np.ndindex(*shape)) == indices:
                arrays.append((stem, shape))
                continue
        arrays += [(name, ()) for name in names]  # an array with entries left out
    return arrays


def _split(name: str) -> tuple[str, tuple[int, ...]]:
    """The name of the array and the place in it, as in M_0_1, h_2 and tau0; of other names no place."""
    match = _ENTRY.fullmatch(name)
    if match is None:
        return name, ()
    return match[1], tuple([int(index) for index in match[2].strip("_").split("_")])
