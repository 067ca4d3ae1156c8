"""A program in Python: over lists for one memory, over arrays for many."""

from __future__ import annotations

import functools
import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

from ..codegen.compile import compile
from ..codegen.compiled import Compiled
from ..core.evaluation import Array
from ..core.graph import Graph
from . import lu_solve
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While
from .runner import Record, Runner

Registers = TypeVar("Registers", list[float], Array)


class PythonRunner(Runner):
    """A program in Python over lists, and many at once over arrays."""

    def __init__(self, program: Program, *, fma: bool = True) -> None:
        super().__init__(program)
        self._fma = fma
        self._functions = {id(graph): compile(graph, "python") for graph in program.graphs()}
        self._arrays: dict[int, Compiled] = {}

    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record:
        program = self.program
        state = {name: memory[place].tolist() for name, place in self._slices.items()}
        rows: list[list[float]] = []
        done = 0
        for done in range(1, passes + 1):
            state.update(_split(feed[done - 1].tolist(), program.feed, state))
            self._statements(program.body, state)
            if done % every == 0 and (program.record_if is None or state[program.record_if][0] > 0.0):
                rows.append([value for name in program.record for value in state[name]])
            if program.stop is not None and state[program.stop][0] != 0.0:
                break
        for name, place in self._slices.items():
            memory[place] = state[name]
        return Record(np.array(rows).reshape(len(rows), program.width), done)

    def _statements(self, statements: Sequence[Statement], state: dict[str, list[float]]) -> None:
        for statement in statements:
            match statement:
                case Call():
                    results = self._functions[id(statement.graph)].values(_joined(state, statement.inputs))
                    state.update(_split(list(results), statement.outputs, state))
                case Map():  # y[i] = graph(x[i])
                    columns = self._elements(statement, state)
                    for slot, name in enumerate(statement.outputs):
                        state[name] = [values[slot] for values in columns]
                case Sum():
                    terms = [values[0] for values in self._elements(statement, state)]
                    state[statement.output] = [functools.reduce(operator.add, terms, 0.0)]  # sum() compensates
                case While():
                    while state[statement.register][0] > 0.0:
                        self._statements(statement.body, state)
                case If():
                    positive = state[statement.register][0] > 0.0
                    self._statements(statement.body if positive else statement.otherwise, state)
                case Factor():  # LU = PA
                    n = len(state[statement.pivots])
                    a, p = np.array(state[statement.matrix]).reshape(n, n), np.empty(n)
                    lu_solve.factor(a, p)
                    state[statement.matrix], state[statement.pivots] = a.ravel().tolist(), p.tolist()
                case Solve():  # b = A^-1 b
                    n = len(state[statement.pivots])
                    a, b = np.array(state[statement.matrix]).reshape(n, n), np.array(state[statement.vector])
                    lu_solve.solve(a, np.array(state[statement.pivots]), b)
                    state[statement.vector] = b.tolist()

    def _elements(self, statement: Map | Sum, state: dict[str, list[float]]) -> list[tuple[float, ...]]:
        count, function = self.program.elements(statement), self._functions[id(statement.graph)]
        inputs = [[value] * count for value in _joined(state, _shared(statement))]
        inputs += [state[name] if len(state[name]) == count else state[name] * count for name in statement.inputs]
        return [function.values(list(values)) for values in zip(*inputs, strict=True)]

    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record:
        program = self.program
        state = {name: memories[place].copy() for name, place in self._slices.items()}
        rows = np.empty((passes // every, program.width, memories.shape[1]))
        shape = (program.feed_width, memories.shape[1])
        for done in range(1, passes + 1):
            state.update(_split(np.broadcast_to(feed[done - 1], shape), program.feed, state))
            for statement in program.body:
                self._statement_many(statement, state)
            if done % every == 0 and program.record:
                np.concatenate([state[name] for name in program.record], out=rows[done // every - 1])
        for name, place in self._slices.items():
            memories[place] = state[name]
        return Record(rows, passes)

    def _statement_many(self, statement: Statement, state: dict[str, Array]) -> None:
        assert isinstance(statement, Call | Map | Sum)
        if isinstance(statement, Call):
            results = self._batch(statement.graph, np.concatenate([state[name] for name in statement.inputs]))
            state.update(_split(results, statement.outputs, state))
            return
        # All elements of all N states are points of one batch: (inputs, elements * N) -> (outputs, elements, N).
        count = self.program.elements(statement)
        shape = (count, next(iter(state.values())).shape[1])
        rows = [row for name in _shared(statement) for row in state[name]]
        rows += [state[name] for name in statement.inputs]
        inputs = np.array([np.broadcast_to(row, shape) for row in rows])
        results = self._batch(statement.graph, inputs.reshape(len(rows), -1)).reshape(-1, *shape)
        if isinstance(statement, Map):
            state.update(zip(statement.outputs, results, strict=True))
        else:
            state[statement.output] = np.add.accumulate(results[0])[-1:] if count else np.zeros((1, shape[1]))

    def _batch(self, graph: Graph, points: Array) -> Array:
        if id(graph) not in self._arrays:
            self._arrays[id(graph)] = compile(graph, "numpy", fma=self._fma)
        return self._arrays[id(graph)].batch(points)


def _shared(statement: Map | Sum) -> tuple[str, ...]:
    return statement.shared if isinstance(statement, Map) else ()


def _joined(state: Mapping[str, list[float]], names: Sequence[str]) -> list[float]:
    return [value for name in names for value in state[name]]


def _split(values: Registers, names: Sequence[str], state: Mapping[str, Registers]) -> Iterator[tuple[str, Registers]]:
    """The values, end to end, by the registers that they go to."""
    at = 0
    for name in names:
        length = len(state[name])
        yield name, values[at : at + length]
        at += length
