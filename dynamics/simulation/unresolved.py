"""What in a rate tells, along a run, how well steps can follow it: waves of the time, jumps and kinks."""

from __future__ import annotations

from collections.abc import Callable

from cgraph import Graph, Node, floor, less

from ..systems.arguments import TIME

WAVES = ("sin", "cos", "tan")
BRANCHES: dict[str, Callable[[Node], Node]] = {
    **dict.fromkeys(("floor", "ceil", "round", "sign", "less", "less_equal", "equal", "not_equal"), lambda node: node),
    **dict.fromkeys(("minimum", "maximum"), lambda node: less(*node.args)),
    "abs": lambda node: less(node.args[0], 0.0),
    "fmod": lambda node: floor(abs(node.args[0] / node.args[1])),
}


def waves_and_branches(rate: Graph) -> Graph | None:
    """What tells, along a run, how well steps can follow a rate; None if there is nothing.

    phase..: what changes with time of all that it takes sines, cosines and tangents of.  branch..: what is another
    number on the other side of a jump or a kink.
    """
    timed = {node for node in rate.inputs if node.name == TIME}
    for node in rate.nodes:
        if not timed.isdisjoint(node.args):
            timed.add(node)
    waves = [node.args[0] for node in rate.nodes if node.op.name in WAVES and node.args[0] in timed]
    branches = [BRANCHES[node.op.name](node) for node in rate.nodes if node.op.name in BRANCHES]
    outputs = {f"phase{k}": node for k, node in enumerate(dict.fromkeys(waves))}
    outputs |= {f"branch{k}": node for k, node in enumerate(dict.fromkeys(branches))}
    return Graph(rate.inputs, outputs) if outputs else None
