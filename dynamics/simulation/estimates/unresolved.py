"""Parts of a rate that steps cannot resolve, along a run: waves in time too fast for them, jumps and kinks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeAlias

import numpy as np

from cgraph import Graph, Node, floor, less, variable, where
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, building

from ...systems.arguments import TIME
from ..steps.row_values import values_of

PARTS, TIMES = 16, 10  # into which the way from one state to the next is divided, and again, to find a branch's change
BURST = 4  # steps: changes of branches no farther apart are one passage, as where friction comes to rest
TOGETHER = 512  # states that are looked at once
WAVES = ("sin", "cos", "tan")

# Of an operation its branch, a number that changes only across its jump or kink; and its value where that is given.
Branch: TypeAlias = tuple[Callable[..., Node], Callable[..., Node]]
BRANCHES: dict[str, Branch] = {
    **dict.fromkeys(
        ("floor", "ceil", "round", "sign", "less", "less_equal", "equal", "not_equal"),
        (lambda node, *args: node, lambda branch, *args: branch),
    ),
    "minimum": (lambda node, a, b: less(a, b), lambda branch, a, b: where(branch, a, b)),
    "maximum": (lambda node, a, b: less(a, b), lambda branch, a, b: where(branch, b, a)),
    "abs": (lambda node, a: less(a, 0.0), lambda branch, a: where(branch, -a, a)),
    "fmod": (lambda node, a, b: where(less(a / b, 0.0), -floor(-(a / b)), floor(a / b)), lambda n, a, b: a - n * b),
}


class Unresolved(NamedTuple):
    """Graphs that tell, along a run, how well steps can follow a rate. All have its inputs, in its order.

    waves: what changes with time of all that it takes sines, cosines and tangents of.  branches: numbers that are
    others on the other side of a jump or a kink.  sides: the rate where these are given, as further inputs.
    """

    waves: Graph | None
    branches: Graph | None
    sides: Graph | None


@kept_by_first
def unresolved(rate: Graph) -> Unresolved:
    """Graphs of the unresolved parts of a rate; None in place of those that it has not."""
    timed = {node for node in rate.inputs if node.name == TIME}
    for node in rate.nodes:
        if not timed.isdisjoint(node.args):
            timed.add(node)
    waves = dict.fromkeys(node.args[0] for node in rate.nodes if node.op.name in WAVES and node.args[0] in timed)
    phases = Graph(rate.inputs, {f"phase{k}": node for k, node in enumerate(waves)}) if waves else None
    word = "branch" + "_" * max(map(len, rate.input_names))  # the name of no input begins so
    bent = [node for node in rate.nodes if node.op.name in BRANCHES]
    if not bent:
        return Unresolved(phases, None, None)
    given = {node: variable(f"{word}{k}") for k, node in enumerate(bent)}
    branches = {f"{word}{k}": BRANCHES[node.op.name][0](node, *node.args) for k, node in enumerate(bent)}
    build, new = Builder(), {node: node for node in rate.inputs}
    with building(build):
        for node in rate.nodes:
            args = tuple([new[arg] for arg in node.args])
            if node in given:
                new[node] = BRANCHES[node.op.name][1](given[node], *args)
            elif node not in new:
                new[node] = build(node.op, args, node.label) if args else node
    sides = Graph([*rate.inputs, *given.values()], {name: new[node] for name, node in rate.outputs.items()})
    return Unresolved(phases, Graph(rate.inputs, branches), sides)


class Watch:
    """What steps of k runs side by side cannot resolve, as the states after all of them come.

    p: values of the parameters, (k, ..).  needed: whether a rate has such parts.  turning: of sines and cosines
    [rad/s], (k,).  bent: whether a jump or a kink was passed, (k,).  missed: by how much steps across these are off,
    added up, (k, m).
    """

    def __init__(self, rate: Graph, order: int, p: Array, t: float, x: Array) -> None:
        """The runs start from x (k, m) at t."""
        self._what, self._order = unresolved(rate), order
        self.needed = self._what.waves is not None or self._what.branches is not None
        self.turning, self.bent, self.missed = np.zeros(len(x)), np.zeros(len(x), dtype=bool), np.zeros(x.shape)
        self._p, self._seen = p, [(np.array([t]), x[:, None])]

    def add(self, t: Array, x: Array) -> None:
        """The next states, (k, r, m), at times t (r,)."""
        if self.needed:
            self._seen.append((t, x))
            if sum([len(times) for times, _ in self._seen]) > TOGETHER:
                self.look()

    def restart(self, t: float, x: Array, p: Array | None = None) -> None:
        """The runs go on from other states x (k, m), or with other parameters."""
        self.look()
        self._p, self._seen = self._p if p is None else p, [(np.array([t]), x[:, None])]

    def look(self) -> None:
        """Look at what has come."""
        if len(self._seen) == 1:
            return
        t, x = np.concatenate([t for t, _ in self._seen]), np.concatenate([x for _, x in self._seen], axis=1)
        self._seen = [(t[-1:], x[:, -1:])]
        if self._what.waves is not None:
            speeds = np.abs(np.diff(_values(self._what.waves, t, x, self._p[:, None]))) / np.abs(np.diff(t))
            self.turning = np.maximum(self.turning, speeds.max(axis=(0, 2)))
        if self._what.branches is not None and self._what.sides is not None:
            self._look_across(self._what.branches, self._what.sides, t, x)

    def _look_across(self, branches: Graph, sides: Graph, t: Array, x: Array) -> None:
        """Note the steps across jumps and kinks.

        A step across a jump may be off by the jump times the way from there to the nearer end of the step; of order 1,
        where the rate is that of one end, by all of the step. Farther from its ends than a share 1 / order a step
        evaluates the rate on both sides, and steps of other lengths differ. Across a kink the two sides differ by what
        the rate has become since: least at the nearer end, too.
        """
        branch = _values(branches, t, x, self._p[:, None])
        run, row = np.nonzero((branch[:, :, 1:] != branch[:, :, :-1]).any(axis=0))
        if not len(run):
            return
        self.bent[run], p = True, self._p[run]
        ends = np.stack([row, row + 1])
        t, x, branch = t[ends], x[run, ends], np.moveaxis(branch[:, run, ends], 1, 0)
        rates = [[_values(sides, t[k], x[k], p, one) for one in branch] for k in (0, 1)]
        apart = np.fmin(*[np.abs(here - there).T for here, there in rates])
        way = 1.0 if self._order == 1 else np.minimum(_way(branches, t, x, branch, p), 1.0 / self._order)
        off = apart * (np.abs(t[1] - t[0]) * way)[:, None]
        first = np.flatnonzero(np.diff(run, prepend=-1) + (np.diff(row, prepend=row[0]) > BURST))
        largest = np.maximum.reduceat(np.where(np.isfinite(off), off, 0.0), first)
        np.add.at(self.missed, run[first], largest)


def _way(branches: Graph, t: Array, x: Array, branch: Array, p: Array) -> Array:
    """Distances, (n,), of the first and last change of a branch in the steps from the nearer end, at most.

    t (2, n), x (2, n, m), branch (2, .., n): at the ends.
    """
    low, length = np.broadcast_to([[0.0], [1.0]], t.shape), np.array([[1.0], [-1.0]])  # from both ends
    parts = np.arange(1.0, PARTS + 1.0) / PARTS
    for _ in range(TIMES):
        shares = low[..., None] + length[..., None] * parts
        inside = x[0][:, None] + shares[..., None] * (x[1] - x[0])[:, None]
        times = t[0][:, None] + shares * (t[1] - t[0])[:, None]
        changed = (_values(branches, times, inside, p[:, None]) != np.moveaxis(branch, 0, 1)[..., None]).any(axis=0)
        low = low + length * (np.where(changed.any(axis=2), changed.argmax(axis=2), PARTS - 1) / PARTS)
        length = length / PARTS
    return np.asarray(np.minimum(low, 1.0 - low).clip(0.0).max(axis=0))


def _values(graph: Graph, t: Array, x: Array, p: Array, more: Iterable[Array] = ()) -> Array:
    """Outputs, (.., *shape), at times t, states x (*shape, m) and parameters p (*shape, ..), and further inputs."""
    columns = [*np.moveaxis(x, -1, 0), t, *np.moveaxis(p, -1, 0), *more]
    return values_of(graph, columns, *x.shape[:-1])
