"""`interp`: a table of data as a function, piecewise polynomials that comparisons choose between."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

from ..core.builder import Builder
from ..core.evaluation import real_array
from ..core.label import SMOOTH, label
from ..core.node import Node, Scalar, as_node, named_node
from ..core.scope import building, current
from ..util.require import require_choice, require_sequence
from .operation import OPS
from .table import abs_, maximum, minimum, not_equal, sign, where

Piece = list[Node]  # a_0, a_1, .. of the polynomial a_0 + a_1 t + a_2 t**2 + .., t = x - start


def interp(
    x: Scalar, xs: Sequence[float], ys: Sequence[Scalar], kind: str = "linear", outside: str = "constant"
) -> Node:
    """The value at x of a function that is known at the points of a table: measured torques, losses, a cam.

    Between knots i and i + 1 it is a polynomial of t = x - xs[i], which comparisons choose. At a knot the derivative is
    that of the polynomial to the right. "natural" has two continuous derivatives, "monotone" one, "linear" none.

    Parameters
    ----------
    x : Node or float
        Where, finite.
    xs : sequence of n >= 2 floats
        Knots, finite and increasing strictly, in the unit of x.
    ys : sequence of n nodes or floats
        Values at the knots: finite numbers, or nodes, such as parameters that are to be identified.
    kind : "linear", "monotone" or "natural"
        Straight lines; cubics that rise and fall with the data (F. N. Fritsch and J. Butland, "A method for
        constructing local monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5, 1984; SciPy's
        `PchipInterpolator`); or the cubic spline whose second derivative is 0 at both ends.
    outside : "constant" or "linear"
        Outside the table: the value at its end, or the straight line with the slope at its end.

    Returns
    -------
    Node
        The value. Of n knots it takes log2 n comparisons, by bisection, and n selections for each of 3 numbers of a
        "linear" table, 5 of another one: a knot and coefficients. A derivative adds a few operations to these.

    Raises
    ------
    TypeError
        For what are no numbers or nodes.
    ValueError
        For knots that do not increase strictly, less than two of them, another count of values, numbers that are not
        finite, slopes too large for float64, and another kind.

    Examples
    --------
    A motor's torque [N m] over its speed [rad/s], measured, and its slope:

    >>> import cgraph as cg
    >>> w = cg.variable("w")
    >>> torque = cg.interp(w, [0.0, 100.0, 200.0, 300.0], [2.0, 1.9, 1.5, 0.0], kind="monotone")
    >>> motor = cg.Graph([w], {"torque": torque})
    >>> motor.evaluate({"w": 100.0}), motor.evaluate({"w": 400.0})
    ({'torque': 1.9}, {'torque': 0.0})
    >>> round(cg.gradient(motor).evaluate({"w": 100.0})["dtorque/dw"], 6)
    -0.0016
    """
    require_choice("kind of interp", kind, tuple(_SLOPES))
    require_choice("outside of interp", outside, ("constant", "linear"))
    at, knots = named_node("x of interp", x), _knots(xs)
    with building(Builder()):  # which computes what is constant
        pieces = _pieces(knots, _values(ys, len(knots)), _SLOPES[kind], straight=outside == "linear")
    if any([each.value is not None and not math.isfinite(each.value) for piece in pieces for each in piece]):
        raise ValueError("interp: a slope of the table is too large for float64")
    if kind != "linear" and outside == "constant":  # the kinks at the ends are these, and no comparison has one
        at = minimum(maximum(at, knots[0]), knots[-1])
    bits, start = _searched(at, [as_node(knot) for knot in knots], {SMOOTH} if kind != "linear" else set())
    t = at - start
    *coefficients, y = [_chosen([*row], bits) for row in reversed([*zip(*pieces, strict=True)])]
    value = coefficients[0]
    for each in (*coefficients[1:], y):  # Horner's scheme
        value = value * t + each
    return value


def _knots(xs: Sequence[float]) -> list[float]:
    array = real_array("xs of interp", xs)
    if array.ndim != 1 or len(array) < 2:
        raise ValueError(f"xs of interp must be a sequence of two knots or more, got shape {array.shape}")
    knots: list[float] = array.tolist()
    if bad := [k for k, knot in enumerate(knots) if not math.isfinite(knot)]:
        raise ValueError(f"xs of interp must be finite, got xs[{bad[0]}] = {knots[bad[0]]!r}")
    for k, (a, b) in enumerate(pairwise(knots)):
        if not a < b:
            raise ValueError(f"xs of interp must increase strictly, got xs[{k}] = {a!r} and xs[{k + 1}] = {b!r}")
    return knots


def _values(ys: Sequence[Scalar], n: int) -> list[Node]:
    values = require_sequence("ys of interp", ys, "numbers or nodes")
    nodes = [named_node(f"ys[{k}] of interp", each) for k, each in enumerate(values)]
    if len(nodes) != n:
        raise ValueError(f"ys of interp must have a value for each of the {n} knots, got {len(nodes)}")
    if bad := [k for k, node in enumerate(nodes) if node.value is not None and not math.isfinite(node.value)]:
        raise ValueError(f"ys of interp must be finite, got ys[{bad[0]}] = {nodes[bad[0]].value!r}")
    return nodes


def _pieces(
    x: list[float], y: list[Node], slopes_of: Callable[[list[float], list[Node]], list[Node]] | None, *, straight: bool
) -> list[Piece]:
    """The polynomials before the first knot, between the knots, and behind the last: the first of t = x - x[0].

    slopes_of: of steps and slopes between the knots, the slopes at the knots; None for straight lines.
    """
    h = [after - before for before, after in pairwise(x)]
    rise = [(after - before) / step for before, after, step in zip(y, y[1:], h, strict=False)]
    zero = as_node(0.0)
    d = rise if slopes_of is None else slopes_of(h, rise)
    inside = [[*each] for each in zip(y, rise, strict=False)]
    if slopes_of is not None:
        inside = [  # Hermite's cubic of values and slopes at both ends
            [value, a, (3.0 * each - 2.0 * a - b) / step, (a + b - 2.0 * each) / step / step]
            for value, a, b, each, step in zip(y, d, d[1:], rise, h, strict=False)
        ]
    more = [zero] * (len(inside[0]) - 2)
    before, after = [[value, slope if straight else zero, *more] for value, slope in ((y[0], d[0]), (y[-1], d[-1]))]
    return [before, *inside, after]


def _monotone(h: list[float], rise: list[Node]) -> list[Node]:
    """Slopes at the knots: the weighted harmonic mean of those beside, 0 where they have different signs."""
    if len(h) == 1:
        return [rise[0], rise[0]]
    inner = []
    for h0, h1, a, b in zip(h, h[1:], rise, rise[1:], strict=False):
        w0, w1 = 2.0 * h1 + h0, h1 + 2.0 * h0
        inner.append(where(sign(a) * sign(b) > 0.0, (w0 + w1) / (w0 / a + w1 / b), 0.0))
    return [_end(h[0], h[1], rise[0], rise[1]), *inner, _end(h[-1], h[-2], rise[-1], rise[-2])]


def _end(h0: float, h1: float, a: Node, b: Node) -> Node:
    """The slope at an end: of the parabola through three points, held where it would overshoot."""
    slope = (a * (2.0 * h0 + h1) - b * h0) / (h0 + h1)
    turns = not_equal(sign(a), sign(b))
    held = where(turns * (abs_(slope) > 3.0 * abs_(a)), 3.0 * a, slope)
    return where(not_equal(sign(slope), sign(a)), 0.0, held)


def _natural(h: list[float], rise: list[Node]) -> list[Node]:
    """Slopes at the knots at which second derivatives are continuous, and 0 at the ends: Thomas's elimination."""
    n = len(h)
    diagonal = [2.0 / h[0], *[2.0 / a + 2.0 / b for a, b in pairwise(h)], 2.0 / h[-1]]
    weighted = [3.0 * each / step for each, step in zip(rise, h, strict=True)]
    right = [weighted[0], *[a + b for a, b in pairwise(weighted)], weighted[-1]]
    for i in range(n):
        factor = 1.0 / h[i] / diagonal[i]
        diagonal[i + 1] -= factor / h[i]
        right[i + 1] = right[i + 1] - factor * right[i]
    d = [right[n] / diagonal[n]]
    for i in reversed(range(n)):
        d.append((right[i] - d[-1] / h[i]) / diagonal[i])
    return d[::-1]


_SLOPES = {"linear": None, "monotone": _monotone, "natural": _natural}


def _searched(at: Node, knots: list[Node], roles: set[str]) -> tuple[list[Node], Node]:
    """Bisection: whether x is left of a knot, step by step, and the knot that it ends at, left of x, or the first.

    The last knot stands for those that are missing to a power of two, less one. The comparisons get these roles, too.
    """
    steps, start = len(knots).bit_length(), knots[0]
    knots = [*knots, *[knots[-1]] * (2**steps - 1 - len(knots))]
    bits: list[Node] = []
    build, told = current.get().build or Node, current.get().label
    told = label(told.tags, told.roles | roles, told.lines)
    for step in reversed(range(steps)):
        knot = _chosen(knots[2**step - 1 :: 2 ** (step + 1)], bits)
        bits.append(build(OPS["less"], (at, knot), told))
        start = start if start is knot else where(bits[-1], start, knot)
    return bits, start


def _chosen(nodes: Sequence[Node], bits: Sequence[Node]) -> Node:
    """The node at a place, of which these are the bits, 1 for the left half; the last one for places behind the last.

    A tree of selections, by the latest bit last, so that the others need not wait for it; but halves first where one is
    missing or nodes at an end are the same, since what is alike needs no selection.
    """
    if len(nodes) == 1:
        return nodes[0]
    half = 2 ** (len(bits) - 1)
    if len(nodes) <= half:
        return _chosen(nodes, bits[1:])
    if len(nodes) < 2 * half or nodes[0] is nodes[1] or nodes[-2] is nodes[-1]:
        bit, left, right = bits[0], _chosen(nodes[:half], bits[1:]), _chosen(nodes[half:], bits[1:])
    else:
        bit, left, right = bits[-1], _chosen(nodes[::2], bits[:-1]), _chosen(nodes[1::2], bits[:-1])
    return left if left is right else where(bit, left, right)
