"""Arrays of nodes: what NumPy's functions and arithmetic make of them, element by element."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from ..core.node import Node, apply
from ..core.row import Row
from .operation import BY_UFUNC

_TURNED = {np.greater: np.less, np.greater_equal: np.less_equal}  # a > b is b < a


def of_ufunc(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], options: Mapping[str, object]) -> Any:
    """`np.sin(node)`, `np.float64(2) * node`, and element by element for arrays of nodes."""
    if ufunc in _TURNED:
        ufunc, inputs = _TURNED[ufunc], inputs[::-1]
    op = BY_UFUNC.get(ufunc) or BY_UFUNC.get(ufunc.__name__)
    if op is None or method != "__call__" or options:
        return NotImplemented
    return elementwise(op, *inputs)


def method_of(node: Node, name: str) -> Callable[..., Node]:
    """The method of that name that NumPy asks of the elements of an array of objects, as in `np.sqrt(array)`."""
    ufunc = getattr(np, name, None)
    if isinstance(ufunc, np.ufunc) and ufunc in BY_UFUNC:
        return partial(apply, BY_UFUNC[ufunc], node)
    raise AttributeError(f"a Node has no attribute {name!r}")


def elementwise(op: Row, *args: Any) -> Any:
    """A node; or an array of nodes, when an argument is an array with dimensions."""
    if any([isinstance(each, np.ndarray) and each.ndim for each in args]):
        return np.frompyfunc(partial(apply, op), op.arity, 1)(*[np.asarray(each, dtype=object) for each in args])
    return apply(op, *[each.item() if isinstance(each, np.ndarray) else each for each in args])
