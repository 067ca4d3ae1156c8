"""Runner: a program made ready to run, as machine code or in Python."""

from __future__ import annotations

import ctypes
import functools
import operator
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..codegen import llvm_engine as llvm
from ..codegen.compile import compile
from ..codegen.compiled import Compiled
from ..codegen.native_function import flags_of
from ..core.evaluate import Array
from ..core.graph import Graph
from ..errors import GraphError
from . import lu_solve as lu
from .llvm_ir import offsets, program_functions, program_ir
from .program import Call, Factor, If, Map, Program, Solve, Statement, Sum, While

BACKENDS = ("auto", "python", "llvm")
_RUN = ctypes.CFUNCTYPE(
    ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p
)


class Record(NamedTuple):
    """What a run left.  rows: (rows, width), or (rows, width, N) of N runs at once.  passes: how many were run."""

    rows: Array
    passes: int


class Runner(ABC):
    """A program ready to run.  program: what it runs.  size: numbers in a memory."""

    def __init__(self, program: Program, width: int = 1) -> None:
        self.program, self.width = program, width
        places = offsets(program, width)
        self._slices = {name: slice(places[name], places[name] + n) for name, n in program.registers.items()}
        self.size = places[""]

    def memory(self, values: Mapping[str, ArrayLike], count: int | None = None) -> Array:
        """A memory (size,), or (size, count) of runs side by side, with these values of registers, 0 elsewhere.

        Raises GraphError for an unknown register or a value of another length.
        """
        memory = np.zeros(self.size if count is None else (self.size, count))
        for name, value in values.items():
            self.write(memory, name, value)
        return memory

    def read(self, memory: Array, name: str) -> Array:
        """The register in a memory, a view (length,). Raises GraphError for an unknown one."""
        if name not in self._slices:
            raise GraphError(f"the program has no register {name!r} (it has {', '.join(self._slices) or 'none'})")
        return memory[self._slices[name]]

    def write(self, memory: Array, name: str, value: ArrayLike) -> None:
        """Set a register. Raises GraphError for an unknown one, or a value of another length."""
        place, given = self.read(memory, name), np.asarray(value, dtype=np.float64)
        if given.ndim and given.shape != place.shape:
            raise GraphError(f"register {name!r} needs shape {place.shape}, got {given.shape}")
        place[...] = given

    def run(self, memory: Array, passes: int, every: int = 1) -> Record:
        """Run that many passes (fewer if the program stops), and record a row after each `every`th.

        memory: (size,), changed in place; what a run leaves there is where the next one goes on.
        Raises GraphError for another shape or kind of memory, or `passes` or `every` out of range.
        """
        self._check(memory, (self.size,), passes, every)
        return self._run(memory, passes, every)

    def run_many(self, memories: Array, passes: int, every: int = 1) -> Record:
        """As `run`, for N memories (size, N) at once, vectors of them together; rows are (rows, width, N).

        Raises GraphError for a program whose course depends on its numbers: While, If, Factor, record_if, stop.
        """
        if not memories.ndim == 2:
            raise GraphError(f"memories must have shape ({self.size}, N), got {memories.shape}")
        self._check(memories, (self.size, memories.shape[1]), passes, every)
        program = self.program
        kinds = {type(each).__name__ for each in program.statements()} & {"While", "If", "Factor", "Solve"}
        kinds |= {name for name in ("record_if", "stop") if getattr(program, name) is not None}
        if kinds:
            raise GraphError(f"runs side by side need the same course for all: no {', '.join(sorted(kinds))}")
        return self._run_many(memories, passes, every)

    def _check(self, memory: Array, shape: tuple[int, ...], passes: int, every: int) -> None:
        if memory.dtype != np.float64 or memory.shape != shape or not memory.flags.c_contiguous:
            raise GraphError(f"a memory must be contiguous float64 of shape {shape}, got {memory.dtype} {memory.shape}")
        if passes < 0 or every < 1:
            raise GraphError(f"passes must be at least 0 and every at least 1, got {passes} and {every}")

    @abstractmethod
    def _run(self, memory: Array, passes: int, every: int) -> Record: ...

    @abstractmethod
    def _run_many(self, memories: Array, passes: int, every: int) -> Record: ...


def runner(program: Program, backend: str = "auto", *, fast: bool = False, fma: bool = True) -> Runner:
    """The program, ready to run: machine code with "llvm", Python with "python", what there is with "auto".

    fast, fma: see `cg.compile`. Raises ValueError for an unknown backend, ImportError for "llvm" without llvmlite.
    """
    if backend not in BACKENDS:
        raise ValueError(f"backend must be one of {', '.join(BACKENDS)}, got {backend!r}")
    if backend != "python":
        try:
            return NativeRunner(program, flags_of(fast, fma))
        except (ImportError, llvm.MissingFunctionError):
            if backend == "llvm":
                raise
    return PlainRunner(program)


class NativeRunner(Runner):
    """A program as machine code. Any number of threads may run it at once, each on its own memory."""

    def __init__(self, program: Program, flags: str) -> None:
        host = llvm.host()
        super().__init__(program, host.lanes)
        self._flags, self._host = flags, host
        self.source = program_ir(program, flags, width=host.lanes)
        self._code = self._host.compile(self.source, program_functions(program))
        self._entry = _RUN(self._code.address("run"))
        self._many: tuple[llvm.Code, Any] | None = None

    def _run(self, memory: Array, passes: int, every: int) -> Record:
        rows = np.empty((passes // every, self.program.width))
        done = ctypes.c_int64()
        count = self._entry(memory.ctypes.data, rows.ctypes.data, passes, every, ctypes.addressof(done))
        return Record(rows[:count], done.value)

    def _run_many(self, memories: Array, passes: int, every: int) -> Record:
        lanes = self._host.lanes
        if self._many is None:
            code = self._host.compile(
                program_ir(self.program, self._flags, lanes, self.width), program_functions(self.program)
            )
            self._many = code, _RUN(code.address("run"))
        entry, total = self._many[1], memories.shape[1]
        rows = np.empty((passes // every, self.program.width, total))
        block, part = np.empty((self.size, lanes)), np.empty((*rows.shape[:2], lanes))
        done = ctypes.c_int64()
        for start in range(0, total, lanes):
            here = slice(start, min(start + lanes, total))
            width = here.stop - start
            block[:, :width], block[:, width:] = memories[:, here], memories[:, start : start + 1]
            entry(block.ctypes.data, part.ctypes.data, passes, every, ctypes.addressof(done))
            memories[:, here], rows[:, :, here] = block[:, :width], part[:, :, :width]
        return Record(rows, passes)


class PlainRunner(Runner):
    """A program in Python over lists, and many at once over arrays."""

    def __init__(self, program: Program) -> None:
        super().__init__(program)
        self._functions = {id(graph): compile(graph, "python") for graph in program.graphs()}
        self._arrays: dict[int, Compiled] = {}

    def _run(self, memory: Array, passes: int, every: int) -> Record:
        program = self.program
        state = {name: memory[place].tolist() for name, place in self._slices.items()}
        rows: list[list[float]] = []
        done = 0
        for done in range(1, passes + 1):
            self._statements(program.body, state)
            if done % every == 0 and (program.record_if is None or state[program.record_if][0] > 0.0):
                rows.append([value for name in program.record for value in state[name]])
            if program.stop is not None and state[program.stop][0] != 0.0:
                break
        for name, place in self._slices.items():
            memory[place] = state[name]
        return Record(np.array(rows).reshape(len(rows), program.width), done)

    def _statements(self, statements: Sequence[Statement], state: dict[str, list[float]]) -> None:
        for each in statements:
            match each:
                case Call():
                    results = self._functions[id(each.graph)].values(_joined(state, each.inputs))
                    at = 0
                    for name in each.outputs:
                        length = len(state[name])
                        state[name] = list(results[at : at + length])
                        at += length
                case Map():
                    columns = self._elements(each, state)
                    for name, values in zip(each.outputs, zip(*columns, strict=True), strict=True):
                        state[name] = list(values)
                case Sum():
                    terms = [values[0] for values in self._elements(each, state)]
                    state[each.output] = [functools.reduce(operator.add, terms, 0.0)]  # sum() compensates
                case While():
                    while state[each.register][0] > 0.0:
                        self._statements(each.body, state)
                case If():
                    self._statements(each.body if state[each.register][0] > 0.0 else each.otherwise, state)
                case Factor():
                    n = len(state[each.pivots])
                    a, p = np.array(state[each.matrix]).reshape(n, n), np.empty(n)
                    lu.factor(a, p)
                    state[each.matrix], state[each.pivots] = a.ravel().tolist(), p.tolist()
                case Solve():
                    n = len(state[each.pivots])
                    a, b = np.array(state[each.matrix]).reshape(n, n), np.array(state[each.vector])
                    lu.solve(a, np.array(state[each.pivots]), b)
                    state[each.vector] = b.tolist()

    def _elements(self, statement: Map | Sum, state: dict[str, list[float]]) -> list[tuple[float, ...]]:
        count, function = self.program.elements(statement), self._functions[id(statement.graph)]
        inputs = [state[name] if len(state[name]) == count else state[name] * count for name in statement.inputs]
        return [function.values(list(values)) for values in zip(*inputs, strict=True)]

    def _run_many(self, memories: Array, passes: int, every: int) -> Record:
        program = self.program
        state = {name: memories[place].copy() for name, place in self._slices.items()}
        rows = np.empty((passes // every, program.width, memories.shape[1]))
        for done in range(1, passes + 1):
            for each in program.body:
                self._statement(each, state)
            if done % every == 0:
                np.concatenate([state[name] for name in program.record], out=rows[done // every - 1])
        for name, place in self._slices.items():
            memories[place] = state[name]
        return Record(rows, passes)

    def _statement(self, each: Statement, state: dict[str, Array]) -> None:
        assert isinstance(each, Call | Map | Sum)
        if isinstance(each, Call):
            results = self._batch(each.graph, np.concatenate([state[name] for name in each.inputs]))
            at = 0
            for name in each.outputs:
                length = len(state[name])
                state[name] = results[at : at + length]
                at += length
            return
        count = self.program.elements(each)
        shape = (count, next(iter(state.values())).shape[1])
        inputs = np.array([np.broadcast_to(state[name], shape) for name in each.inputs])
        results = self._batch(each.graph, inputs.reshape(len(each.inputs), -1)).reshape(-1, *shape)
        if isinstance(each, Map):
            state.update(zip(each.outputs, results, strict=True))
        else:
            state[each.output] = np.add.accumulate(results[0])[-1:] if count else np.zeros((1, shape[1]))

    def _batch(self, graph: Graph, points: Array) -> Array:
        if id(graph) not in self._arrays:
            self._arrays[id(graph)] = compile(graph, "numpy")
        return self._arrays[id(graph)].batch(points)


def _joined(state: Mapping[str, list[float]], names: Sequence[str]) -> list[float]:
    return [value for name in names for value in state[name]]
