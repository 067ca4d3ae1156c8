"""A program in Python: over lists for one memory, over arrays for many."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...codegen.python_function import OnArrays, OnFloats
from ...core.evaluation import Array
from ...core.graph import Graph
from ...util.require import require_kind
from ..program import Program, whole_graph
from ..statement import Execution
from ..statements.call import spread
from .runner import Columns, Record, Register, Registers, Runner, Start

BLOCK = 4096  # points that NumPy takes at once: temporaries stay in the cache
STATES = 512  # states of a batch that are run between looks at the keyboard


class PythonRunner(Runner):
    """A program in Python over lists, and many at once over arrays.

    fma: if not, NumPy has its functions from the C library, too.
    backend: of a program of one call, "python" for lists alone, "numpy" for arrays alone.
    """

    vector_cost = 20  # NumPy's call, against one of Python's operators

    def __init__(self, program: Program, *, fma: bool = True, backend: str = "auto") -> None:
        super().__init__(program)
        self._fma, self._backend = fma, backend
        self._execution = Execution(program.registers, self._at, self._batch)
        self._functions: dict[int, OnFloats] = {}
        self._arrays: dict[int, OnArrays] = {}

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        program, execution = self.program, self._execution
        state = {name: numbers.tolist() for name, numbers in self.shared.items()}
        state |= {name: memory[place].tolist() for name, place in self._slices.items()}
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
        program, count, masked = self.program, memories.shape[1], self.masked
        execution = Execution(masked.registers, self._at, self._batch, count)
        state = {name: np.zeros((length, count)) for name, length in masked.registers.items()}
        state |= {name: memories[place].copy() for name, place in self._slices.items()}
        state |= {name: np.broadcast_to(each[:, None], (len(each), count)) for name, each in self.shared.items()}
        rows = np.empty((passes // every, program.width, count))
        for done in range(1, passes + 1):
            spread(np.broadcast_to(feed[done - 1], (program.feed_width, count)), program.feed, state)
            execution.run(masked.body, state)
            if done % every == 0 and program.record:
                np.concatenate([state[name] for name in program.record], out=rows[done // every - 1])
        for name, place in self._slices.items():
            memories[place] = state[name]
        return Record(rows, passes)

    def _bind(self, memory: Array, rows: Array | None) -> Callable[..., None]:
        def run(passes: int = 0 if rows is None else len(rows)) -> None:
            found = self._run(memory, passes, passes + 1 if rows is None else 1, np.empty((passes, 0))).rows
            if rows is not None:
                rows[: len(found)] = found

        return run

    def bind_pass(self, x: Register, y: Register) -> tuple[Callable[[], None], Registers]:
        """Registers are lists in between."""
        arrays = {name: np.zeros(n) for name, n in self.program.registers.items() if name not in (x[0], y[0])}
        arrays |= {name: numbers.copy() for name, numbers in self.shared.items()}
        flat, point = y[1].reshape(-1), x[1]
        if (graph := whole_graph(self.program, x[0])) is not None:
            if self._backend == "numpy":
                columns = self._on_arrays(graph), point[:, None], flat[:, None]
                return lambda: columns[0](*columns[1:]), arrays
            function = self.on_floats(graph)

            def call() -> None:
                flat[:] = function(point.tolist())

            return call, arrays
        arrays[y[0]] = flat

        def run() -> None:
            state: dict[str, Any] = {**arrays, x[0]: point.tolist()}
            self._execution.run(self.program.body, state)
            for name, array in arrays.items():
                if state[name] is not array:
                    array[:] = state[name]

        return run, arrays

    def columns_from(self, name: str, start: Start) -> tuple[int, Columns]:
        """Of one graph its function of arrays; "python" alone goes point by point."""
        if (graph := whole_graph(self.program, name)) is None:
            begin = start()

            def write(values: Array, records: Array) -> None:
                count = values.shape[1]
                others = {each: np.repeat(numbers[:, None], count, axis=1) for each, numbers in begin.items()}
                memories = self.memory({name: values, **others}, count)
                records[...] = self._run_many(memories, 1, 1, np.empty((1, 0, count))).rows[0]

            return STATES, write
        if self._backend != "python":
            return BLOCK, self._on_arrays(graph)
        function = self.on_floats(graph)

        def one_by_one(points: Array, result: Array) -> None:
            for column, x in enumerate(points.T.tolist()):
                result[:, column] = function(x)

        return sys.maxsize, one_by_one  # the interpreter runs one thread at a time

    def text(self, x: str) -> str:
        """The text of one graph in Python, or in NumPy; of other programs their listing."""
        graph = whole_graph(self.program, require_kind("x", x, str))
        of = self._on_arrays if self._backend == "numpy" else self.on_floats
        return self.program.listing() if graph is None else of(graph).source

    def on_floats(self, graph: Graph) -> OnFloats:
        """The graph as a function of a list."""
        return self._functions.get(id(graph)) or self._functions.setdefault(id(graph), OnFloats(graph))

    def _on_arrays(self, graph: Graph) -> OnArrays:
        exact = not self._fma
        return self._arrays.get(id(graph)) or self._arrays.setdefault(id(graph), OnArrays(graph, exact=exact))

    def _at(self, graph: Graph, x: Sequence[float]) -> Sequence[float]:
        return self.on_floats(graph)(x)

    def _batch(self, graph: Graph, points: Array) -> Array:
        result, function = np.empty((len(graph.outputs), points.shape[1])), self._on_arrays(graph)
        for start in range(0, points.shape[1], BLOCK):
            here = slice(start, start + BLOCK)
            function(points[:, here], result[:, here])
        return result
