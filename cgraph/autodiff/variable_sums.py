"""Sums z = p w + p' a that hold the only use of a variable w: z can be eliminated in place of w."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..core.node import Node


class VariableSum(NamedTuple):
    """The terms of z = p variable + p_other other; p and p_other are 1 or -1."""

    variable: Node
    other: Node
    p: float
    p_other: float


def variable_sums(order: Sequence[Node], position: Mapping[Node, int]) -> dict[Node, VariableSum]:
    """The sums and differences with the only use of a variable; where both terms are such, the later variable's.

    order: nodes, arguments first.  position: {variable: its place among all}.
    """
    uses: dict[Node, int] = {}
    for node in order:
        for arg in node.args:
            uses[arg] = uses.get(arg, 0) + 1
    sums = {}
    for node in order:
        if node.op.name in ("add", "sub"):
            signs = (1.0, 1.0 if node.op.name == "add" else -1.0)
            free = [k for k, arg in enumerate(node.args) if arg in position and uses[arg] == 1]
            if free:
                k = max(free, key=lambda k: position[node.args[k]])
                sums[node] = VariableSum(node.args[k], node.args[1 - k], signs[k], signs[1 - k])
    return sums
