"""A program in Python: over lists for one memory, over arrays for many."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ...codegen.python_function import OnArrays, OnFloats
from ...core.evaluation import Array
from ...core.graph import Graph
from ..program import Program, whole_graph
from ..statement import Execution
from ..statements.call import spread
from .runner import Record, Runner

BLOCK = 4096  # points that NumPy takes at once: temporaries stay in the cache


class PythonRunner(Runner):
    """A program in Python over lists, and many at once over arrays.

    fma: if not, NumPy has its functions from the C library, too, one element after another.
    backend: of a program of one call, "python" for lists alone, "numpy" for arrays alone.
    """

    vector_cost = 20  # NumPy's call, against one of Python's operators

    def __init__(self, program: Program, *, fma: bool = True, backend: str = "auto") -> None:
        super().__init__(program)
        self._fma, self._backend = fma, backend
        self._functions: dict[int, OnFloats] = {}
        self._arrays: dict[int, OnArrays] = {}

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        program = self.program
        execution = Execution(program.registers, self._at, self._batch)
        state = {name: memory[place].tolist() for name, place in self._slices.items()}
        rows: list[list[float]] = []
        done = 0
        for done in range(1, passes + 1):
            spread(feed[done - 1].tolist(), program.feed, state)
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
            spread(np.broadcast_to(feed[done - 1], (program.feed_width, count)), program.feed, state)
            execution.run(masked.body, state)
            if done % every == 0 and program.record:
                np.concatenate([state[name] for name in program.record], out=rows[done // every - 1])
        for name, place in self._slices.items():
            memories[place] = state[name]
        return Record(rows, passes)

    def _bind_pass(self, x: tuple[str, Array], y: tuple[str, Array]) -> tuple[Callable[[], None], Mapping[str, Array]]:
        arrays = {name: np.zeros(length) for name, length in self.program.registers.items() if name not in (x[0], y[0])}
        flat = arrays[y[0]] = y[1].reshape(-1)
        if (graph := whole_graph(self.program, x[0])) is not None:
            on_lists, point = self._on_lists(x[0]), x[1]

            def call() -> None:
                if on_lists is not None:
                    flat[:] = on_lists(point.tolist())
                else:
                    self._on_arrays(graph)(point[:, None], flat[:, None])

            return call, arrays
        execution = Execution(self.program.registers, self._at, self._batch)

        def run() -> None:
            state: dict[str, Any] = {**arrays, x[0]: x[1].tolist()}
            execution.run(self.program.body, state)
            for name, array in arrays.items():
                if state[name] is not array:
                    array[:] = state[name]

        return run, arrays

    def _columns(
        self, name: str, start: Mapping[str, Array] = MappingProxyType({})
    ) -> tuple[int, Callable[[Array, Array], None]]:
        if (graph := whole_graph(self.program, name)) is None:
            return super()._columns(name, start)
        if self._backend != "python":
            return BLOCK, self._on_arrays(graph)

        function = self._on_floats(graph)

        def one_by_one(points: Array, result: Array) -> None:
            for column, x in enumerate(points.T.tolist()):
                result[:, column] = function(x)

        return sys.maxsize, one_by_one  # the interpreter runs one thread at a time

    def _point_text(self, x: str, y: str) -> str:
        """The text in Python, of one graph."""
        if self._backend == "numpy":
            return self._batch_text(x)
        return self._on_floats(self._graph(x)).source

    def _batch_text(self, name: str) -> str:
        """The text in NumPy, of one graph."""
        return self._on_arrays(self._graph(name)).source

    def _on_lists(self, name: str) -> OnFloats | None:
        """The function of lists, of one graph."""
        return None if self._backend == "numpy" else self._on_floats(self._graph(name))

    def _graph(self, name: str) -> Graph:
        graph = whole_graph(self.program, name)
        assert graph is not None
        return graph

    def _on_floats(self, graph: Graph) -> OnFloats:
        if id(graph) not in self._functions:
            self._functions[id(graph)] = OnFloats(graph)
        return self._functions[id(graph)]

    def _on_arrays(self, graph: Graph) -> OnArrays:
        if id(graph) not in self._arrays:
            self._arrays[id(graph)] = OnArrays(graph, exact=not self._fma)
        return self._arrays[id(graph)]

    def _at(self, graph: Graph, x: Sequence[float]) -> Sequence[float]:
        return self._on_floats(graph)(x)

    def _batch(self, graph: Graph, points: Array) -> Array:
        result, function = np.empty((len(graph.outputs), points.shape[1])), self._on_arrays(graph)
        for start in range(0, points.shape[1], BLOCK):
            here = slice(start, start + BLOCK)
            function(points[:, here], result[:, here])
        return result
