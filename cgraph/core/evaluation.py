"""Evaluation: values of the outputs on floats, or on arrays that broadcast."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .node import CONSTANT, VARIABLE, Node

Array = np.ndarray[Any, np.dtype[np.float64]]
Value = float | Array


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
