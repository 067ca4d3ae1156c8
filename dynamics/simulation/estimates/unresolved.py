"""Parts of a rate that steps cannot resolve, along a run: waves in time too fast for them, jumps and kinks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from cgraph import Graph, Node, floor, less, variable, where
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder, building

from ...systems.arguments import TIME
from ..steps.row_values import values_of

PARTS, TIMES = 16, 10  # into which the way from one state to the next is divided, and again, to find a branch's change
BURST = (
    4  # steps, by which changes of branches are apart that are those of one passage, as where friction comes to rest
)
TOGETHER = 512  # states that are looked at once
WAVES = ("sin", "cos", "tan")


class Branch(NamedTuple):
    """Branch of an operation: a number that changes only across its jump or kink, and its value where that is given."""

    of: Callable[..., Node]
    given: Callable[..., Node]


BRANCHES = {
    **{
        name: Branch(lambda node, *args: node, lambda branch, *args: branch)
        for name in ("floor", "ceil", "round", "sign", "less", "less_equal", "equal", "not_equal")
    },
    "minimum": Branch(lambda node, a, b: less(a, b), lambda branch, a, b: where(branch, a, b)),
    "maximum": Branch(lambda node, a, b: less(a, b), lambda branch, a, b: where(branch, b, a)),
    "abs": Branch(lambda node, a: less(a, 0.0), lambda branch, a: where(branch, -a, a)),
    "fmod": Branch(lambda node, a, b: _whole(a / b), lambda branch, a, b: a - branch * b),
}


def _whole(ratio: Node) -> Node:
    """The whole number next to it towards 0."""
    return where(less(ratio, 0.0), -floor(-ratio), floor(ratio))


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
    bent = [node for node in rate.nodes if node.op.name in BRANCHES]
    phases = Graph(rate.inputs, {f"phase{k}": node for k, node in enumerate(waves)}) if waves else None
    if not bent:
        return Unresolved(phases, None, None)
    word = "branch" + "_" * max(map(len, rate.input_names))  # the name of no input begins so
    branches = {f"{word}{k}": BRANCHES[node.op.name].of(node, *node.args) for k, node in enumerate(bent)}
    return Unresolved(phases, Graph(rate.inputs, branches), _sides(rate, dict(zip(bent, branches, strict=True))))


def _sides(rate: Graph, names: dict[Node, str]) -> Graph:
    """The rate where what these nodes branch on is given, by inputs of these names."""
    given = {node: variable(name) for node, name in names.items()}
    build, new = Builder(), {node: node for node in rate.inputs}
    with building(build):
        for node in rate.nodes:
            args = tuple([new[arg] for arg in node.args])
            if node in given:
                new[node] = BRANCHES[node.op.name].given(given[node], *args)
            elif node not in new:
                new[node] = build(node.op, args, node.label) if args else node
    return Graph([*rate.inputs, *given.values()], {name: new[node] for name, node in rate.outputs.items()})


def is_watched(rate: Graph) -> bool:
    """Whether a rate has parts that steps may not resolve."""
    return any(graph is not None for graph in unresolved(rate))


class Watch:
    """What steps of k runs side by side cannot resolve, as the states after all of them come.

    p: values of the parameters, (k, ..).  turning: of sines and cosines [rad/s], (k,).  bent: whether a jump or a kink
    was passed, (k,).  missed: by how much steps across these are off, added up, (k, m).
    """

    def __init__(self, rate: Graph, order: int, p: Array, t: float, x: Array) -> None:
        """The runs start from x (k, m) at t."""
        self._what, self._order, self._p, self.needed = unresolved(rate), order, p, is_watched(rate)
        self.turning, self.bent, self.missed = np.zeros(len(x)), np.zeros(len(x), dtype=bool), np.zeros(x.shape)
        self._seen = [(np.array([t]), x[:, None])]

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
            phases = _values(self._what.waves, t, x, self._p[:, None])
            speeds = np.abs(np.diff(phases)) / np.abs(np.diff(t))
            self.turning = np.maximum(self.turning, speeds.max(axis=(0, 2)))
        if self._what.branches is not None:
            self._look_for_branches(self._what.branches, t, x)

    def _look_for_branches(self, branches: Graph, t: Array, x: Array) -> None:
        """Note the steps across jumps and kinks.

        A step across a jump may be off by the jump times the way from there to the nearer end of the step; of order 1,
        where the rate is that of one end, by all of the step. Farther from its ends than a share 1 / order a step
        evaluates the rate on both sides, and steps of other lengths differ. Across a kink the two sides differ by what
        the rate has become since: least at the nearer end, too.
        """
        assert self._what.sides is not None
        branch = _values(branches, t, x, self._p[:, None])
        run, row = np.nonzero((branch[:, :, 1:] != branch[:, :, :-1]).any(axis=0))
        if not len(run):
            return
        self.bent[run], p = True, self._p[run]
        ends = [_End(t[at], x[run, at], branch[:, run, at]) for at in (row, row + 1)]
        rates = [[_values(self._what.sides, end.t, end.x, p, each.branch) for each in ends] for end in ends]
        apart = np.fmin(*[np.abs(here - there).T for here, there in rates])
        way = np.ones(len(run)) if self._order == 1 else np.minimum(_way(branches, *ends, p), 1.0 / self._order)
        off = apart * (np.abs(ends[1].t - ends[0].t) * way)[:, None]
        first = np.flatnonzero(np.diff(run, prepend=-1) + (np.diff(row, prepend=row[0]) > BURST))
        largest = np.maximum.reduceat(np.where(np.isfinite(off), off, 0.0), first)
        np.add.at(self.missed, run[first], largest)


class _End(NamedTuple):
    """Ends of steps: times (n,), states (n, m) and branches (.., n)."""

    t: Array
    x: Array
    branch: Array


def _way(branches: Graph, begin: _End, end: _End, p: Array) -> Array:
    """Distances, (n,), of the first and last change of a branch in the steps from the nearer end, at most."""
    low, length = np.array([[0.0], [1.0]]), np.array([[1.0], [-1.0]])  # from both ends
    sides = np.stack([begin.branch, end.branch], axis=1)[..., None]
    parts = np.arange(1.0, PARTS + 1.0) / PARTS
    low = np.broadcast_to(low, (2, len(p)))
    for _ in range(TIMES):
        shares = low[..., None] + length[..., None] * parts
        x = begin.x[:, None] + shares[..., None] * (end.x - begin.x)[:, None]
        t = begin.t[:, None] + shares * (end.t - begin.t)[:, None]
        other = (_values(branches, t, x, p[:, None]) != sides).any(axis=0)
        low = low + length * (np.where(other.any(axis=2), other.argmax(axis=2), PARTS - 1) / PARTS)
        length = length / PARTS
    return np.asarray(np.minimum(low, 1.0 - low).clip(0.0).max(axis=0))


def _values(graph: Graph, t: Array, x: Array, p: Array, more: Iterable[Array] = ()) -> Array:
    """Outputs, (.., *shape), at times t, states x (*shape, m) and parameters p (*shape, ..), and further inputs."""
    columns = [*np.moveaxis(x, -1, 0), t, *np.moveaxis(p, -1, 0), *more]
    return values_of(graph, columns, *x.shape[:-1])
