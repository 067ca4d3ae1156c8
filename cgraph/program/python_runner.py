"""A program in Python: over lists for one memory, over arrays for many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..codegen.compile import compile
from ..codegen.compiled import Compiled
from ..core.evaluation import Array
from ..core.graph import Graph
from .execution import Execution
from .program import Program
from .runner import Record, Runner


class PythonRunner(Runner):
    """A program in Python over lists, and many at once over arrays."""

    def __init__(self, program: Program, *, fma: bool = True) -> None:
        super().__init__(program)
        self._fma = fma
        self._functions = {id(graph): compile(graph, "python") for graph in program.graphs()}
        self._arrays: dict[int, Compiled] = {}

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        program = self.program
        execution = Execution(program.registers, self._at, self._batch)
        state = {name: memory[place].tolist() for name, place in self._slices.items()}
        rows: list[list[float]] = []
        done = 0
        for done in range(1, passes + 1):
            state.update(_split(feed[done - 1].tolist(), program.feed, program.registers))
            execution.run(program.body, state)
            if done % every == 0 and (program.record_if is None or state[program.record_if][0] > 0.0):
                rows.append([value for name in program.record for value in state[name]])
            if program.stop is not None and state[program.stop][0] != 0.0:
                break
        for name, place in self._slices.items():
            memory[place] = state[name]
        return Record(np.array(rows).reshape(len(rows), program.width), done)

    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record:
        program, count = self.program, memories.shape[1]
        masked = self.masked
        execution = Execution(masked.registers, self._at, self._batch, count)
        state = {name: np.zeros((length, count)) for name, length in masked.registers.items()}
        state |= {name: memories[place].copy() for name, place in self._slices.items()}
        rows = np.empty((passes // every, program.width, count))
        for done in range(1, passes + 1):
            fed = np.broadcast_to(feed[done - 1], (program.feed_width, count))
            state.update(_split(fed, program.feed, program.registers))
            execution.run(masked.body, state)
            if done % every == 0 and program.record:
                np.concatenate([state[name] for name in program.record], out=rows[done // every - 1])
        for name, place in self._slices.items():
            memories[place] = state[name]
        return Record(rows, passes)

    def _at(self, graph: Graph, x: Sequence[float]) -> Sequence[float]:
        return self._functions[id(graph)].values(list(x))

    def _batch(self, graph: Graph, points: Array) -> Array:
        if id(graph) not in self._arrays:
            self._arrays[id(graph)] = compile(graph, "numpy", fma=self._fma)
        return self._arrays[id(graph)].batch(points)


def _split(values: Any, names: Sequence[str], lengths: Mapping[str, int]) -> dict[str, Any]:
    """The values, end to end, by the registers that they go to."""
    at, parts = 0, {}
    for name in names:
        parts[name] = values[at : at + lengths[name]]
        at += lengths[name]
    return parts
