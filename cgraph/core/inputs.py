"""Inputs of a graph as a caller names them, and the values that they get: checked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from numbers import Real

import numpy as np

from .checks import GraphError
from .evaluation import Value
from .node import Node, variable
from .real_arrays import real_array, real_number


def input_values(names: Sequence[str], values: object) -> dict[str, Value]:
    """{name: a float, or an array of float64} of all inputs, in shapes that broadcast.

    Raises GraphError for a missing or unknown name or shapes that do not broadcast, TypeError for a value that is
    not real.
    """
    if not isinstance(values, Mapping):
        raise TypeError(f"evaluate takes a mapping {{input: value}}, got {type(values).__name__}: {values!r:.60}")
    read = {name: _as_value(name, value) for name, value in values.items()}
    if missing := [name for name in names if name not in read]:
        raise GraphError(f"no value for input {', '.join(missing)}")
    known = set(names)
    if unknown := [name for name in read if name not in known]:
        raise GraphError(f"the graph has no input {', '.join(map(str, unknown))} (it has {', '.join(names) or 'none'})")
    shapes = {name: value.shape for name, value in read.items() if isinstance(value, np.ndarray)}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise GraphError(f"the inputs' shapes do not broadcast: {listed}") from None
    return read


def _as_value(name: str, value: object) -> Value:
    if type(value) is float:
        return value
    array = real_array(f"input {name!r}", value)
    return array if array.ndim else float(array)


def chosen_inputs(given: Sequence[Node], wrt: str | Node | Sequence[str | Node]) -> tuple[Node, ...]:
    """Those of a graph's inputs that `wrt` names. Raises as `Graph.select_inputs`."""
    if not isinstance(wrt, (str, Node, Iterable)):
        raise TypeError(f"wrt must name inputs by strings or variables, got {type(wrt).__name__}: {wrt!r:.60}")
    inputs, chosen = set(given), dict[Node, None]()
    names = ", ".join([str(node.name) for node in given]) or "none"
    for name in (wrt,) if isinstance(wrt, (str, Node)) else wrt:
        node = variable(name) if isinstance(name, str) else name
        if not isinstance(node, Node):
            raise TypeError(f"wrt must name inputs by strings or variables, got {node!r:.60}")
        if node not in inputs:
            raise GraphError(f"the graph has no input {node.name or node!r} (it has {names})")
        if node in chosen:
            raise GraphError(f"wrt names the input {node.name} twice")
        chosen[node] = None
    if not chosen:
        raise GraphError(f"wrt must name at least one input (the graph has {names})")
    return tuple(chosen)


def box_interval(name: str, value: object) -> tuple[float, float]:
    """The interval of an input of a box, given as (low, high) or as a number. Raises ValueError for what is none."""
    ends = (value, value) if isinstance(value, Real) else value
    if not isinstance(ends, (tuple, list)) or len(ends) != 2:
        raise ValueError(f"box: input {name!r} needs (low, high) or a number, got {value!r:.60}")
    low, high = ends
    if not all([isinstance(end, Real) and not isinstance(end, bool) for end in ends]) or not low <= high:
        raise ValueError(f"box: input {name!r} needs numbers low <= high, got {value!r:.60}")
    return real_number(f"box: input {name!r}", low), real_number(f"box: input {name!r}", high)
