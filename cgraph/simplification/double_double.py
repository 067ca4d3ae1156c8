"""Double-double: a graph whose arithmetic keeps twice the digits, by nodes for what rounding takes off.

Every value is a pair hi + lo of numbers, lo at most about an ulp of hi: some 104 bits. The rules are the operations'
own, in `operations.double_double`; an operation without one takes the low parts of its arguments to first order.
"""

from __future__ import annotations

from ..core.graph import Graph
from ..core.label import Label
from ..core.node import CONSTANT, Node, apply, as_node, constant
from ..core.row import Row
from ..core.scope import building
from ..core.traversal import topological
from ..operations.double_double import ZERO, Pair, normal
from ..operations.operation import columns
from ..operations.table import zero_safe_mul
from ..util.require import require_flag, require_graph
from ..writing.naming import free_suffix


def double_double(graph: Graph, *, low: bool = False) -> Graph:
    """The function, with sums, differences, products, quotients and roots to twice the digits of float64.

    Tags and roles stay. Inputs and constants count as exact. Functions (sin, exp, ..) are those of float64 with the low
    part of their argument to first order: to an ulp, which is like a rounding of the data.

    For arithmetic that cancels, such as accelerations of chains whose masses differ by 1e12, and to see what rounding
    does to a graph: the difference from it is its error. Sums become some 20 operations, products 30, quotients 50.
    Every back end keeps them, fused multiply-add or not, but `fast=True` and `cg.simplify`, which take sums in another
    order, do not: simplify before. What overflows becomes NaN, from 1e300 on for the operands of a product.

    Parameters
    ----------
    graph : Graph
        Any graph.
    low : bool
        Add an output NAME_low for each output: what its rounding to float64 took off. Where such a name is taken the
        suffix is `_low2`, `_low3`, ...

    Returns
    -------
    Graph
        With the same inputs and outputs, the outputs rounded to float64.

    Raises
    ------
    TypeError
        If it is not a graph.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> graph = cg.Graph([x], {"y": (x + 1e16) - 1e16})
    >>> graph.evaluate({"x": 1.0}), cg.double_double(graph).evaluate({"x": 1.0})
    ({'y': 0.0}, {'y': 1.0})
    """
    require_graph("double_double", graph)
    pairs: dict[Node, Pair] = {}
    with building(_made) as labelled:
        for node in topological(graph.outputs.values()):
            labelled(node.label)
            if not node.args:
                pairs[node] = Pair(node, ZERO)
            else:
                pairs[node] = _pair(node, [pairs[arg] for arg in node.args])
    outputs = {name: pairs[node].hi for name, node in graph.outputs.items()}
    if require_flag("low", low):
        suffix = free_suffix("_low", graph.outputs, list(graph.outputs))
        outputs |= {f"{name}{suffix}": pairs[node].lo for name, node in graph.outputs.items()}
    return Graph(graph.inputs, outputs)


def _made(op: Row, args: tuple[Node, ...], label: Label, name: str | None = None) -> Node:
    """A node as it is written, but of constants the constant."""
    if all([arg.op is CONSTANT for arg in args]):
        value = op.scalar(*[arg.value for arg in args])
        if value == value:
            return constant(value)
    return Node(op, args, label, name=name)


def _pair(node: Node, args: list[Pair]) -> Pair:
    rule = columns(node.op).double_double
    pair: Pair | None = rule(*args) if rule is not None else None
    return pair if pair is not None else _to_first_order(node.op, args)


def _to_first_order(op: Row, args: list[Pair]) -> Pair:
    hi = apply(op, *[arg.hi for arg in args])
    if all([arg.lo is ZERO for arg in args]):
        return Pair(hi, ZERO)
    lo = ZERO
    for arg, partial in zip(args, op.partials(hi, *[arg.hi for arg in args]), strict=True):
        if arg.lo is not ZERO:
            change = zero_safe_mul(arg.lo, as_node(partial))  # a low part of 0 counts for nothing at a singular point
            lo = change if lo is ZERO else lo + change
    return normal(hi, lo)
