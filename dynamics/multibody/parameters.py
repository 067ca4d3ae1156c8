"""Parameters in place of numbers: what names and nodes stand for, and numbers put in for them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import as_node, topological

from ..systems.kinematics import substitute

Quantity = float | Node | str  # a number, a node over parameters, or a parameter's name
Quantities = ArrayLike | Sequence[Quantity] | Sequence[Sequence[Quantity]]


def entries(value: object) -> list[Any]:
    """The entries of a quantity, of an array or of nested sequences of them."""
    if isinstance(value, str | Node | float):
        return [value]
    if isinstance(value, tuple) and all([isinstance(each, str | Node | float) for each in value]):
        return list(value)
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return value.ravel().tolist()
    try:
        flat: list[Any] = np.asarray(value, dtype=object).ravel().tolist()
    except ValueError:  # rows of unlike shapes
        return []
    return flat


def names_in(values: Iterable[object]) -> dict[str, None]:
    """Names of the parameters and variables of quantities, in order."""
    result: dict[str, None] = {}
    for each in [each for each in values if type(each) is not float]:
        if isinstance(each, Node):
            result |= {str(node.name): None for node in topological([each]) if node.op.name == "variable"}
        elif isinstance(each, str):
            result[each] = None
    return result


def symbol(value: Quantity) -> float | Node:
    """The quantity with a node for a name."""
    return cg.variable(value) if isinstance(value, str) else value


def vanishes(value: object) -> bool:
    """Whether the quantities are zero whatever the parameters are."""
    return all([not isinstance(each, Node) and each == 0.0 for each in entries(value)])


def bound(value: object, values: Mapping[str, float]) -> Any:
    """The quantity, or the array of them, with numbers in place of these parameters."""
    known = entries(value)
    used = names_in(known)
    if not used.keys() & values.keys():
        return value
    nodes = [as_node(symbol(each)) for each in known]
    if used.keys() <= values.keys():
        rows = evaluated(value, {name: values[name] for name in used})
        return rows.item() if rows.ndim == 0 else rows
    numbers = {cg.variable(name): cg.constant(values[name]) for name in used if name in values}
    partly = substitute(nodes, numbers)
    if len(partly) == 1 and isinstance(value, str | Node):
        return partly[0]
    result = np.empty(len(partly), dtype=object)
    result[:] = partly
    return result.reshape(np.shape(np.asarray(value, dtype=object)))


def evaluated(value: object, values: Mapping[str, ArrayLike]) -> Array:
    """The quantities as numbers at these values, or at N of them: an array of their shape, or (N, ..)."""
    nodes = [as_node(symbol(each)) for each in entries(value)]
    graph = Graph(cg.variables(list(values)), {f"{k}": node for k, node in enumerate(nodes)})
    at: dict[str, Any] = dict(values)
    rows = np.broadcast_arrays(*[np.asarray(each) for each in graph.evaluate(at).values()])
    shape = () if isinstance(value, str | Node) else np.shape(np.asarray(value, dtype=object))
    return np.stack(rows, axis=-1).astype(np.float64).reshape((*rows[0].shape, *shape))
