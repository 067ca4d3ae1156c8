"""Rounding growth: how far the errors of all operations carry to some nodes, at sample points."""

from __future__ import annotations

import numpy as np

from ..core.evaluation import Array, Value
from ..core.node import CONSTANT, Node
from ..core.traversal import topological
from ..operations.operation import columns

UNIT = 2.0**-30  # in place of 2^-53: errors that double precision can show
MORE = 8.0  # times the error, that another form may have


def as_accurate(old: Node, new: Node) -> bool:
    """Whether the errors of all operations carry no further to `new` than to `old`, up to a small factor.

    At points near 0, near 1, anywhere, and where all variables are large and alike, so that their differences cancel.
    """
    names = sorted({node.name or "" for node in topological([old, new]) if not node.args and node.op is not CONSTANT})
    points = dict(zip(names, _points(len(names)), strict=True))
    with np.errstate(all="ignore"):
        (value, before), (_, after) = _errors(old, points), _errors(new, points)
        usable = np.isfinite(value) & np.isfinite(before)
        worse = ~(after <= MORE * np.maximum(before, UNIT * np.abs(value)))  # what is not finite is worse
    return not np.any(usable & worse)


def _points(count: int) -> Array:
    """Samples of so many variables, (count, points)."""
    rng = np.random.default_rng(count)
    noise = rng.normal(size=(4, count, 6))
    regimes = noise[0], 1e-3 * noise[1], np.exp(0.3 * noise[2]), 1e3 * (1.0 + 1e-3 * noise[3])
    return np.concatenate(regimes, axis=1)


def _errors(node: Node, points: dict[str, Array]) -> tuple[Array, Array]:
    """The value, and a bound of its error with operations that round to a part of `UNIT`, to first order."""
    known: dict[Node, tuple[Value, Value]] = {}
    for inner in topological([node]):
        if not inner.args:
            value = points[inner.name or ""] if inner.value is None else inner.value
            known[inner] = (value, 0.0)
            continue
        values = [known[arg][0] for arg in inner.args]
        value = inner.op.array(*values)
        error = columns(inner.op).rounding * UNIT * np.abs(value)
        for k, arg in enumerate(inner.args):
            moved = [*values[:k], values[k] + known[arg][1], *values[k + 1 :]]
            error = error + np.abs(inner.op.array(*moved) - value)
        known[inner] = (value, error)
    value, error = known[node]
    count = len(next(iter(points.values()), ()))
    return np.broadcast_to(value, count), np.broadcast_to(error, count)
