"""EventLog: the crossings of a run, collected block by block, and whether one ends it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cgraph import Graph
from cgraph.extend import Array

from ..integrators import Problem, quantity, quantity_inputs
from .dense_output import StepBlock, with_hermite
from .event import Event
from .event_location import crossings
from .trajectory import Crossings


class EventLog:
    """The events of a run: where they happened so far, and, in `status`, whether one has ended it."""

    def __init__(self, problem: Problem, events: Sequence[Event]) -> None:
        self.problem, self.events = problem, events
        self.status = ""
        self._crossings: list[tuple[int, float, Array]] = []
        outputs = {event.name: quantity(problem, f"event {event.name!r}", event.value) for event in events}
        self._graph = problem.bind(problem.states, Graph(quantity_inputs(problem), outputs)) if events else None

    def __call__(self, block: StepBlock) -> StepBlock:
        """Note the events of these steps. The steps up to the event that ends the run, or all of them."""
        if not self.events:
            return block
        dense = with_hermite(block, self.problem) if block.dense is None else block
        for number, t, x in crossings(self._values, self.events, dense):
            self._crossings.append((number, t, x))
            if self.events[number].terminal:
                self.status = f"event {self.events[number].name!r} at t = {t:.6g} s"
                return dense.until(t, x)
        return block

    def _values(self, t: Array, x: Array) -> Array:
        assert self._graph is not None
        values = dict(zip(self._graph.input_names, [*x.T, t], strict=True))
        return np.array([np.broadcast_to(value, t.shape) for value in self._graph.evaluate(values).values()])

    def crossings(self, half: int) -> dict[str, Crossings]:
        """Of each event by name, with states split after `half` numbers into q and qd."""
        result = {}
        for number, event in enumerate(self.events):
            matching = [(t, x) for k, t, x in self._crossings if k == number]
            states = np.array([x for _, x in matching]).reshape(len(matching), self.problem.size)
            result[event.name] = Crossings(np.array([t for t, _ in matching]), states[:, :half], states[:, half:])
        return result
