"""Rounding growth: how far the errors of all operations carry to some nodes, at a point or at samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..core.evaluation import Array, Value, evaluate
from ..core.graph import Graph
from ..core.node import CONSTANT, Node, as_node
from ..core.traversal import topological
from ..operations.operation import OPS, columns
from ..util.require import require_graph, require_mapping

ERROR_UNIT = 2.0**-30  # in place of 2^-53: errors that double precision can show
MORE_ERROR = 8.0  # times the error, that another form may have


def as_accurate(old: Node, new: Node) -> bool:
    """Whether the errors of all operations carry no further to `new` than to `old`, up to a small factor.

    At points near 0, near 1, anywhere, and where all variables are large and alike, so that their differences cancel.
    """
    names = sorted({node.name or "" for node in topological([old, new]) if not node.args and node.op is not CONSTANT})
    noise = np.random.default_rng(len(names)).normal(size=(4, len(names), 6))
    regimes = noise[0], 1e-3 * noise[1], np.exp(0.3 * noise[2]), 1e3 * (1.0 + 1e-3 * noise[3])
    points = dict(zip(names, np.concatenate(regimes, axis=1), strict=True))
    (values, errors), (_, others) = (error_bounds(topological([node]), points) for node in (old, new))
    value, before, after = values[old], errors[old], others[new]
    with np.errstate(all="ignore"):
        usable = np.isfinite(value) & np.isfinite(before)
        worse = ~(after <= MORE_ERROR * np.maximum(before, ERROR_UNIT * np.abs(value)))  # what is not finite is worse
    return not np.any(usable & worse)


def error_bounds(
    nodes: Sequence[Node],
    values: Mapping[str, Value],
    unit: float = ERROR_UNIT,
    of_inputs: float = 0.0,
) -> tuple[dict[Node, Value], dict[Node, Value]]:
    """Values of nodes, arguments first, and bounds of their errors to first order, with roundings to a part of `unit`.

    An error passes on through the local partials, in absolute value, and each operation adds its own.
    values: {input: number or array}.  of_inputs: error of an input, relative to its value.
    """
    partials, found = _with_partials(nodes, values)
    errors: dict[Node, Value] = {}
    with np.errstate(all="ignore"):
        for node in nodes:
            pairs = zip(partials.get(node, ()), node.args, strict=True)
            inherited = [OPS["zero_safe_mul"].array(np.abs(found[slope]), errors[arg]) for slope, arg in pairs]
            errors[node] = sum(inherited) + _own_error(node, found[node], unit, of_inputs)
    return found, errors


def output_bounds(
    nodes: Sequence[Node],
    outputs: Sequence[Node],
    values: Mapping[str, Array],
    unit: float,
    of_inputs: float,
    stored: Callable[[float], float],
) -> tuple[dict[Node, Value], Array]:
    """Values of nodes, arguments first, and bounds, (outputs, points), of the errors of outputs to first order.

    An output's error is the sum of all own errors times its derivatives, by a reverse sweep: ways cancel with their
    signs, where `error_bounds` adds up sizes. Arguments as there, values of (points,).  stored: a constant, as the
    program has it.
    """
    partials, found = _with_partials(nodes, values)
    bars: dict[Node, Array] = {}  # derivatives of the outputs by a node, (outputs, points)
    for k, node in enumerate(outputs):
        bars.setdefault(node, np.zeros((len(outputs), 1)))[k] = 1.0
    points = np.broadcast_shapes(*[np.shape(value) for value in values.values()])
    total = np.zeros((len(outputs), *(points or (1,))))  # without inputs there is one point
    with np.errstate(all="ignore"):
        for node in reversed(nodes):
            if (bar := bars.pop(node, None)) is None:
                continue
            total += OPS["zero_safe_mul"].array(np.abs(bar), _own_error(node, found[node], unit, of_inputs, stored))
            for slope, arg in zip(partials.get(node, ()), node.args, strict=True):
                share = OPS["zero_safe_mul"].array(found[slope], bar)
                bars[arg] = bars[arg] + share if arg in bars else share
    return found, total


def _with_partials(
    nodes: Sequence[Node], values: Mapping[str, Value]
) -> tuple[dict[Node, tuple[Node, ...]], dict[Node, Value]]:
    """Local partials of operations, and values of all nodes and of these."""
    partials = {node: tuple(map(as_node, node.op.partials(node, *node.args))) for node in nodes if node.args}
    needed = topological([*nodes, *[slope for slopes in partials.values() for slope in slopes]])
    numbered = {str(i): node for i, node in enumerate(needed)}
    return partials, dict(zip(needed, evaluate(needed, numbered, values).values(), strict=True))


def _own_error(
    node: Node, value: Value, unit: float, of_inputs: float, stored: Callable[[float], float] = float
) -> Value:
    """The error that a node adds by itself: of an operation, an input, or a constant as it is stored."""
    if node.value is not None:
        return abs(stored(node.value) - node.value)
    return (unit * columns(node.op).rounding if node.args else of_inputs) * np.abs(value)


_POINTS, _SIGNS = 256, 1021  # samples, whose mean is certain to a tenth; operations with signs of their own


def rounding_spread(graph: Graph, values: Mapping[str, float], sizes: Mapping[str, float] | None = None) -> float:
    """Relative shift of the worst output, in parts of 2^-30, where results are off by 2^-30, either way at random.

    The mean of the sample points where that is finite, infinite without any. A bound adds sizes where errors cancel.
    values: {input: number}; the other inputs are normally distributed, the same every time.
    sizes: what inputs are drawn of, and outputs compared by; default 1.
    """
    require_graph("rounding_spread", graph)
    require_mapping("values", values, "name: number")
    known_sizes = {} if sizes is None else require_mapping("sizes", sizes, "name: number")
    rng = np.random.default_rng(0)
    factors = 1.0 + ERROR_UNIT * rng.choice([-1.0, 1.0], size=(_SIGNS, 2 * _POINTS))
    factors[:, :_POINTS] = 1.0
    samples: dict[str, Value] = {
        name: known_sizes.get(name, 1.0) * np.tile(rng.normal(size=_POINTS), 2) for name in graph.input_names
    }
    samples |= values
    with np.errstate(all="ignore"):
        found = _with_errors(graph, samples, factors)
        found /= np.array([[known_sizes.get(name, 1.0)] for name in graph.outputs])
        exact, moved = found[:, :_POINTS], found[:, _POINTS:]
        spread = np.abs(moved - exact).max(axis=0) / np.abs(exact).max(axis=0)
    usable = spread[np.isfinite(spread)]
    return float(usable.mean()) / ERROR_UNIT if len(usable) else np.inf


def rounding_noise(graph: Graph, values: Mapping[str, float], count: int = 16) -> tuple[Array, Array]:
    """Outputs at a point, and how far roundings, each either way at random, move them at most in so many trials."""
    factors = 1.0 + ERROR_UNIT * np.random.default_rng(0).choice([-1.0, 1.0], size=(_SIGNS, 1 + count))
    factors[:, 0] = 1.0
    with np.errstate(all="ignore"):
        found = _with_errors(graph, values, factors)
        exact = found[:, 0]
        return exact, np.abs(found - exact[:, None]).max(axis=1) * (2.0**-53 / ERROR_UNIT)


def _with_errors(graph: Graph, inputs: Mapping[str, Value], factors: Array) -> Array:
    """Outputs, (outputs, columns), where results of operations that round are times these factors, in turn."""
    known: dict[Node, Value] = {}
    for k, node in enumerate(topological(list(graph.outputs.values()))):
        if node.args:
            value = node.op.array(*[known[arg] for arg in node.args])
            known[node] = value * factors[k % _SIGNS] if columns(node.op).rounding else value
        else:
            known[node] = inputs[node.name or ""] if node.value is None else node.value
    return np.array([np.broadcast_to(known[node], factors.shape[1]) for node in graph.outputs.values()], dtype=float)
