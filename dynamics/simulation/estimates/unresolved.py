"""What steps cannot resolve of a rate, along a run: waves in time too fast for them, jumps and kinks."""

from __future__ import annotations

import numpy as np

from cgraph import Graph, Node, floor, less, where
from cgraph._shared import Array, kept_by_first

from ...systems.arguments import TIME
from ..steps.row_values import values_of

TOGETHER = 512  # states that are looked at once
WAVES = ("sin", "cos", "tan")
JUMPS = ("floor", "ceil", "round", "sign", "less", "less_equal", "equal", "not_equal")


def _branches(node: Node) -> list[Node]:
    """A number that changes only across the jump or the kink of a node's operation, if it has one."""
    name, args = node.op.name, node.args
    if name in JUMPS:
        return [node]
    if name in ("minimum", "maximum"):
        return [less(*args)]
    if name == "abs":
        return [less(args[0], 0.0)]
    if name == "fmod":
        turns = args[0] / args[1]
        return [where(less(turns, 0.0), -floor(-turns), floor(turns))]
    return []


@kept_by_first
def unresolved(rate: Graph) -> tuple[Graph | None, int]:
    """Phases of waves in time, then branches, over the inputs of a rate; None if it has neither. How many phases."""
    timed = {node for node in rate.inputs if node.name == TIME}
    for node in rate.nodes:
        if not timed.isdisjoint(node.args):
            timed.add(node)
    waves = dict.fromkeys(node.args[0] for node in rate.nodes if node.op.name in WAVES and node.args[0] in timed)
    found = [*waves, *[branch for node in rate.nodes for branch in _branches(node)]]
    return (Graph(rate.inputs, {f"y{k}": node for k, node in enumerate(found)}) if found else None), len(waves)


class Watch:
    """What steps of k runs side by side, from x (k, m) at t with parameters p (k, ..), do not resolve.

    needed: whether a rate has such parts.  turning: the fastest of sines and cosines [rad/s], (k,).  bent: start of the
    first step that passes a jump or a kink [s], NaN if none does, (k,).
    """

    def __init__(self, rate: Graph, p: Array, t: float, x: Array) -> None:
        self._graph, self._waves = unresolved(rate)
        self.needed = self._graph is not None
        self.turning, self.bent = np.zeros(len(x)), np.full(len(x), np.nan)
        self._p, self._seen = p, list[tuple[Array, Array]]()
        self.restart(t, x)

    def restart(self, t: float, x: Array) -> None:
        """The runs go on from other states x (k, m)."""
        self.look()
        self._seen = [(np.array([t]), x[:, None])]

    def add(self, t: Array, x: Array) -> None:
        """The next states, (k, r, m), at times t (r,)."""
        if self.needed:
            self._seen.append((t, x))
            if sum([len(times) for times, _ in self._seen]) > TOGETHER:
                self.look()

    def look(self) -> None:
        """Look at what has come."""
        if self._graph is None or len(self._seen) < 2:
            return
        t, x = np.concatenate([t for t, _ in self._seen]), np.concatenate([x for _, x in self._seen], axis=1)
        self._seen = [(t[-1:], x[:, -1:])]
        columns = [*np.moveaxis(x, -1, 0), t, *np.moveaxis(self._p[:, None], -1, 0)]
        change = np.abs(np.diff(values_of(self._graph, columns, *x.shape[:-1])))
        speeds = change[: self._waves] / np.abs(np.diff(t))
        self.turning = np.maximum(self.turning, speeds.max(axis=(0, 2), initial=0.0))
        passes = (change[self._waves :] != 0.0).any(axis=0)
        first = np.where(passes.any(axis=1), t[passes.argmax(axis=1)], np.nan)
        self.bent = np.where(np.isnan(self.bent), first, self.bent)
