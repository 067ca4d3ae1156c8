"""Evaluation: values of the outputs on floats, or on arrays that broadcast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..util.real_arrays import real_array
from .checks import GraphError
from .node import CONSTANT, VARIABLE, Node

Array = np.ndarray[Any, np.dtype[np.float64]]
Value = float | Array


def evaluate(
    inputs: Sequence[Node], nodes: Sequence[Node], outputs: Mapping[str, Node], values: Mapping[str, Value]
) -> dict[str, Value]:
    """Values of `outputs`: floats when every input is a number, else arrays of the common broadcast shape.

    Arithmetic is IEEE float64: out of a function's domain the result is NaN or infinite, and nothing is raised.
    Raises GraphError for a missing or unknown name or shapes that do not broadcast, TypeError for a value that is
    not real.
    """
    if not isinstance(values, Mapping):
        raise TypeError(f"evaluate takes a mapping {{input: value}}, got {type(values).__name__}: {values!r:.60}")
    read = {name: _as_value(name, value) for name, value in values.items()}
    names = [str(node.name) for node in inputs]
    if missing := [name for name in names if name not in read]:
        raise GraphError(f"no value for input {', '.join(missing)}")
    known = set(names)
    if unknown := [name for name in read if name not in known]:
        raise GraphError(f"the graph has no input {', '.join(map(str, unknown))} (it has {', '.join(names) or 'none'})")
    shape = _common_shape(read)

    last_use = {} if shape is None else {arg: node for node in nodes for arg in node.args}
    kept = set(outputs.values())
    env: dict[Node, Value] = {}
    with np.errstate(all="ignore"):
        for node in nodes:
            op = node.op
            if op is VARIABLE:
                env[node] = read[str(node.name)]
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
    taken = {id(value) for value in read.values()}  # arrays of others: inputs, and outputs of the same node
    filled: dict[str, Value] = {}
    for name, value in results.items():
        filled[name] = np.array(value) if id(value) in taken else value
        filled[name] = _filled(filled[name], shape)
        taken.add(id(value))
    return filled


def _as_value(name: str, value: Any) -> Value:
    if type(value) is float:
        return value
    array = real_array(f"input {name!r}", value)
    return array if array.ndim else float(array)


def _common_shape(values: Mapping[str, Value]) -> tuple[int, ...] | None:
    shapes = {name: value.shape for name, value in values.items() if isinstance(value, np.ndarray)}
    if not shapes:
        return None
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        listed = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise GraphError(f"the inputs' shapes do not broadcast: {listed}") from None


def _filled(value: Value, shape: tuple[int, ...]) -> Value:
    return value if isinstance(value, np.ndarray) and value.shape == shape else np.array(np.broadcast_to(value, shape))
