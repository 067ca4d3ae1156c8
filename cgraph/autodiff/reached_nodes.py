"""Which nodes a derivative reaches where branches are taken or not: flags that keep an infinity elsewhere out of it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ..core.node import Node, Op
from ..core.ops import where, zero_safe_mul


class ReachedNodes:
    """The flags of nodes that one sweep, forward or reverse, reaches through operations that select.

    A selecting operation such as `where` has the partial 0 in an argument that it leaves out. Beyond it, whichever way
    the sweep goes, the tangent or cotangent is 0 and must stay so, though partials there may be infinite or NaN. A zero
    of any other origin is no such zero: times infinity it is NaN, as it should be.

    seeds: {seed: its value}, if a zero of it means the same, which matters where an operation has a singular slope;
    else {seed: None}.
    """

    def __init__(self, seeds: Mapping[Node, Node | None]) -> None:
        # {node: what is not 0 where the sweep reaches it; None: it always does}
        self._flags: dict[Node, Node | None] = dict(seeds)
        self._behind_selection: set[Node] = set()

    def product(self, op: Op, source: Node, a: Node, b: Node) -> Node:
        """a * b for a partial of `op` and the tangent or cotangent of `source`; 0 where the sweep misses `source`."""
        if op.selects or 0.0 in (a.value, b.value):
            return zero_safe_mul(a, b)
        flag = self._flags.get(source)
        may_be_infinite = op.singular is not None or source in self._behind_selection
        if flag is None or not may_be_infinite or _is_finite(a) or _is_finite(b):
            return a * b
        return where(flag, a * b, 0.0)

    def pass_on(self, op: Op, source: Node, target: Node, partial: Node) -> None:
        """Say that the sweep reaches `target` from `source`, through an operation with this partial."""
        flag = self._flags.get(source)
        if op.selects:
            flag = partial if flag is None else where(flag, partial, 0.0)
        if op.selects or source in self._behind_selection:
            self._behind_selection.add(target)
        other = self._flags.setdefault(target, flag)
        if other is not flag:
            self._flags[target] = None if flag is None or other is None else where(other, 1.0, flag)


def _is_finite(a: Node) -> bool:
    """Whether a factor is a finite constant: a slope that takes 0 to 0, or a cotangent that is nowhere 0."""
    return a.value is not None and math.isfinite(a.value)
