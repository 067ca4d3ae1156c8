"""Forward mode: tangents pushed from the inputs to the outputs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from .builder import Builder
from .label import TANGENT
from .node import Node, apply, as_node
from .row import ROWS, Row
from .scope import building
from .traversal import topological


def tangents(
    seeds: Mapping[Node, Node],
    outputs: Iterable[Node],
    build: Builder | None = None,
    *,
    zero_wins: bool = False,
) -> dict[Node, Node]:
    """Tangents y_dot = sum over seeds x of (dy/dx) x_dot, {y: y_dot}, of all that `outputs` reach; absent where zero.

    seeds: {x: x_dot}, leaves or inner nodes, which count as independent.  build: what makes the nodes.
    zero_wins: a seed that is zero counts for nothing, also where a slope is infinite or NaN; else the result is NaN.

    >>> import cgraph as cg
    >>> from cgraph.extend import tangents
    >>> x, x_dot = cg.variables("x x_dot")
    >>> y = cg.exp(x)
    >>> tangents({x: x_dot}, [y])[y].args  # y_dot = y * x_dot
    (<node exp>, <node variable x_dot>)
    """
    dots = dict(seeds)
    along = any([seed.value is None for seed in seeds.values()])  # else one of several columns, which share slopes
    reached = ReachedNodes(seeds if zero_wins else dict.fromkeys(seeds))
    with building(build or Builder()) as labelled:
        for node in topological(outputs):
            if node in dots or not any([arg in dots for arg in node.args]):
                continue
            labelled(node.label.derived(TANGENT))
            total: Node | None = None
            moving = [arg for arg in node.args if arg in dots]
            divisor, partials = reached.quotient(node, moving, once=along and len(moving) > 1)
            for arg, partial in zip(node.args, partials, strict=True):
                if arg in dots:
                    term = reached.product(node.op, arg, partial, dots[arg], bounded=divisor is not None)
                    total = term if total is None else total + term
                    if term.value != 0.0:
                        reached.pass_on(node.op, arg, node, partial)
            assert total is not None
            if divisor is not None:
                total = total / divisor
            if total.value != 0.0:
                dots[node] = total
    return dots


class ReachedNodes:
    """Flags of nodes, each a node that is not 0 exactly where one sweep, forward or reverse, reaches it.

    Beyond an argument that `where` leaves out, tangents and cotangents stay 0, though partials there may be infinite:
    in where(x > 0, log(x), x) at x = 0 what log(x) passes to x is 0, not 0 times 1 / x.
    seeds: {seed: its flag}: its value, where a seed that is 0 is to reach nothing; else None.
    """

    def __init__(self, seeds: Mapping[Node, Node | None]) -> None:
        self._flags: dict[Node, Node | None] = dict(seeds)  # None: the sweep reaches the node everywhere
        self._behind_selection: set[Node] = set()

    def quotient(self, node: Node, sources: Sequence[Node], *, once: bool) -> tuple[Node | None, Sequence[Node]]:
        """A divisor of a node's partials, and these times it; or None, and the partials.

        By these a sweep divides once, last, and needs no guard, for 0 / divisor is 0; but columns can share partials.
        sources: what it passes from.  once: whether to divide so where no guard is needed, too.
        """
        rule, form = node.op.quotient, None
        flagged = any([self._flags.get(source) is not None for source in sources])
        if rule is not None and (once or flagged) and not self._behind_selection.intersection(sources):
            form = rule(node, *node.args)
        divisor, partials = form or (None, node.op.partials(node, *node.args))
        return None if divisor is None else as_node(divisor), [as_node(each) for each in partials]

    def product(self, op: Row, source: Node, a: Node, b: Node, *, bounded: bool = False) -> Node:
        """a * b for a partial of `op` and the tangent or cotangent of `source`; 0 where the sweep misses `source`.

        bounded: whether the partial is finite where the value is, so that no guard is needed.
        """
        if op.selects or 0.0 in (a.value, b.value):  # then 0 times anything is 0: what a branch not taken contributes
            return apply(ROWS["zero_safe_mul"], a, b)
        flag = self._flags.get(source)
        may_be_infinite = (op.singular is not None and not bounded) or source in self._behind_selection
        # With a finite constant no flag is needed: a constant slope takes 0 to 0, a constant cotangent is nowhere 0.
        if flag is None or not may_be_infinite or any([x.value is not None and math.isfinite(x.value) for x in (a, b)]):
            return a * b
        return apply(ROWS["where"], flag, a * b, 0.0)

    def pass_on(self, op: Row, source: Node, target: Node, partial: Node) -> None:
        """Say that the sweep reaches `target` from `source`, through an operation with this partial."""
        flag = self._flags.get(source)
        if op.selects:  # where `source` is reached and the partial is not 0, a logical and
            flag = partial if flag is None else apply(ROWS["where"], flag, partial, 0.0)
        if op.selects or source in self._behind_selection:
            self._behind_selection.add(target)
        other = self._flags.setdefault(target, flag)
        if other is not flag:  # reached in two ways: not 0 where one of the flags is, a logical or
            self._flags[target] = None if flag is None or other is None else apply(ROWS["where"], other, 1.0, flag)
