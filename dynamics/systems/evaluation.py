"""Evaluation: statements that give the rate of a state, a call of its graph or loops over the rows of a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, with_names
from cgraph.extend import Call, Program, Runner, Statement, runner

BLOCK = 64  # points that are taken at once
TRIALS = 16  # of a point


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Statements from the registers x, t and p to the register slope.

    called: the graph that an evaluation calls, the whole rate or the forces; over x, t and p.  lengths: of registers
    that statements work in.  shared: those of these that all memories share, tables.
    """

    called: Graph
    statements: tuple[Statement, ...]
    lengths: Mapping[str, int] = field(default_factory=dict)
    shared: Mapping[str, Array] = field(default_factory=dict)

    def at(self, state: str, time: str, slope: str, *, exact: bool = False) -> list[Statement]:
        """The statements from these registers and p to another.  exact: see `Call`."""
        names = {"x": state, "t": time, "slope": slope}
        made = [with_names(each, lambda name: names.get(name, name)) for each in self.statements]
        return [replace(each, exact=exact) if isinstance(each, Call) else each for each in made]


@dataclass(eq=False, repr=False)
class ByRows(Graph):
    """A graph over states, t and parameters that is run by loops; its nodes are derived when something asks for them.

    names: of its inputs.  sizes: numbers of states and of outputs.  straight: derives the graph, or raises ValueError.
    p: values of the last parameters, which are no inputs.
    """

    names: Sequence[str]
    sizes: tuple[int, int]
    evaluation: Evaluation
    straight: Callable[[], Graph]
    p: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        self.inputs = tuple(cg.variables(list(self.names)))

    def __getattr__(self, name: str) -> Any:
        if name not in ("nodes", "outputs"):
            raise AttributeError(name)
        straight = self.straight()
        self.nodes, self.outputs = straight.nodes, straight.outputs
        return getattr(straight, name)

    def __reduce__(self) -> tuple[Any, ...]:
        return ByRows, (self.names, self.sizes, self.evaluation, without_graph, self.p)

    def bound(self, values: Mapping[str, float]) -> ByRows:
        """The same with numbers for its parameters."""
        straight, names = lambda: cg.specialize(self.straight(), values), self.names[: -len(values)]
        return replace(self, names=names, p=tuple(values.values()), straight=straight)

    def batch(self, points: Array) -> Array:
        """Values (outputs, N) at points (inputs, N)."""
        m, run, parts = self.sizes[0], self._runner, []
        for part in np.split(points, range(BLOCK, points.shape[1], BLOCK), axis=1):
            count, p = part.shape[1], np.tile(np.reshape(self.p, (-1, 1)), part.shape[1])
            memory = run.memory({"x": part[:m], "t": part[m : m + 1], "p": np.vstack([part[m + 1 :], p])}, count)
            parts.append(run.run(memory, 1).rows[0])
        return np.concatenate(parts, axis=1)

    def noise(self, point: Mapping[str, float]) -> tuple[Array, Array]:
        """The values at a point, and how far a rounding of each of its numbers moves them, see `rounding_noise`."""
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (len(self.inputs), 1 + TRIALS))
        signs[:, 0] = 0.0
        found = self.batch(np.array([[point[name]] for name in self.input_names]) + 2.0**-53 * signs)
        return found[:, 0], np.abs(found - found[:, :1]).max(axis=1)

    @cached_property
    def _runner(self) -> Runner:
        made, (m, width) = self.evaluation, self.sizes
        p = len(self.inputs) + len(self.p) - m - 1
        lengths = {"x": m, "t": 1, "p": p, "slope": width, **made.lengths}
        return runner(Program(lengths, made.statements, ["slope"], shared=made.shared))


def without_graph() -> Graph:
    """Raises ValueError: there is none."""
    how = "rows step motions by explicit methods, such as 'dop853' and 'rk4', under forces that neither jump nor kink"
    raise ValueError(f"{how}, and have no graph for anything else: take the bodies themselves, rows.mechanism")


def evaluation_of(rate: Graph) -> Evaluation:
    """The statements that evaluate a rate."""
    return rate.evaluation if isinstance(rate, ByRows) else Evaluation(rate, (Call(rate, ("x", "t", "p"), ("slope",)),))
