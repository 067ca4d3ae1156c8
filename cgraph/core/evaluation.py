"""Evaluation: values of the inputs, checked, and of the outputs, on floats or on arrays that broadcast."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .checks import GraphError
from .node import CONSTANT, VARIABLE, Node

Array = np.ndarray[Any, np.dtype[np.float64]]
Value = float | Array

_KINDS = {"c": "complex numbers", "U": "text", "S": "text", "M": "dates", "m": "time spans"}


def evaluate(nodes: Sequence[Node], outputs: Mapping[str, Node], values: Mapping[str, Value]) -> dict[str, Value]:
    """Values of `outputs`: floats when every input is a number, else arrays of the common broadcast shape.

    Arithmetic is IEEE float64: out of a function's domain the result is NaN or infinite, and nothing is raised.
    values: {name of an input: its value}, arrays of shapes that broadcast.
    """
    arrays = [value for value in values.values() if isinstance(value, np.ndarray)]
    shape = np.broadcast_shapes(*[array.shape for array in arrays]) if arrays else None
    last_use = {} if shape is None else {arg: node for node in nodes for arg in node.args}
    kept = set(outputs.values())
    env: dict[Node, Value] = {}
    with np.errstate(all="ignore"):
        for node in nodes:
            op = node.op
            if op is VARIABLE:
                env[node] = values[str(node.name)]
            elif op is CONSTANT:
                assert node.value is not None
                env[node] = node.value
            else:
                args = [env[arg] for arg in node.args]
                for value in args:
                    if type(value) is not float:
                        env[node] = op.array(*args)
                        break
                else:
                    env[node] = op.scalar(*args)
                if last_use:
                    for arg in node.args:  # free an array after its last use
                        if last_use[arg] is node and arg not in kept:
                            env.pop(arg, None)
    results = {name: env[node] for name, node in outputs.items()}
    if shape is None:
        return results
    taken = {id(value) for value in values.values()}  # the caller's, then earlier results: these are copied, not shared
    filled: dict[str, Value] = {}
    for name, value in results.items():
        fits = isinstance(value, np.ndarray) and value.shape == shape and id(value) not in taken
        filled[name] = value if fits else np.array(np.broadcast_to(value, shape))
        taken.add(id(value))
    return filled


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


def real_array(what: str, value: object) -> Array:
    """The value as an array of float64, itself if it is one.

    Raises TypeError for complex numbers, text, dates and masked values, ValueError for rows of different lengths and a
    number too large for float64.
    """
    value = floats(value)
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if np.ma.is_masked(value) or (isinstance(value, list | tuple) and any([each is np.ma.masked for each in value])):
        raise TypeError(f"{what} must be real numbers, got an array with masked values")
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{what} must be an array of real numbers, got rows of different lengths") from None
    except OverflowError:
        raise ValueError(f"{what} must be real numbers, got one that is too large for float64") from None
    if array.dtype.kind == "O":
        bad = next((item for item in array.ravel() if not isinstance(item, numbers.Real)), None)
        if bad is not None or None in array.ravel().tolist():
            raise TypeError(f"{what} must be real numbers, got {type(bad).__name__}: {bad!r:.60}")
    elif array.dtype.kind not in "biuf":
        raise TypeError(f"{what} must be real numbers, got {_KINDS.get(array.dtype.kind, str(array.dtype))}")
    try:
        return array.astype(np.float64)
    except OverflowError:
        raise ValueError(f"{what} must be real numbers, got one that is too large for float64") from None


def floats(value: Any) -> Any:
    """A list or tuple of floats as an array, which needs no more checks; any other value as it is."""
    return np.array(value) if type(value) in (list, tuple) and {*map(type, value)} == {float} else value


def real_number(what: str, value: object) -> float:
    """The value as a float. Raises TypeError for what is no real number, ValueError for one too large for float64."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise TypeError(f"{what} must be a number, got {type(value).__name__}: {value!r:.60}")
    try:
        return float(value)
    except OverflowError:
        raise ValueError(f"{what} must be a number, got one that is too large for float64") from None


def is_finite(value: object) -> bool:
    """Whether a value is a real number that is finite in float64."""
    try:
        return isinstance(value, numbers.Real) and math.isfinite(value)
    except OverflowError:
        return False


def box_interval(name: str, value: object) -> tuple[float, float]:
    """The interval of an input of a box, given as (low, high) or as a number. Raises ValueError for what is none."""
    ends = (value, value) if isinstance(value, numbers.Real) else value
    if not isinstance(ends, (tuple, list)) or len(ends) != 2:
        raise ValueError(f"box: input {name!r} needs (low, high) or a number, got {value!r:.60}")
    low, high = ends
    if not all([isinstance(end, numbers.Real) and not isinstance(end, bool) for end in ends]) or not low <= high:
        raise ValueError(f"box: input {name!r} needs numbers low <= high, got {value!r:.60}")
    return real_number(f"box: input {name!r}", low), real_number(f"box: input {name!r}", high)
