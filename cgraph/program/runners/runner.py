"""Runner: what a program made ready to run can do, whatever runs it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...util.caches import made_once
from ...util.memory import aligned, require_memory
from ...util.require import require_kind, require_mapping, require_whole
from ..many import many
from ..program import Program
from ..writer import layout

if TYPE_CHECKING:
    from .batch_code import LaneCode

Register = tuple[str, Array]  # of a name these numbers
Registers = Mapping[str, Array]  # by names
Columns = Callable[[Array, Array], None]
Start = Callable[[], Mapping[str, Array]]  # gives initial values of registers


class Record(NamedTuple):
    """The rows of a run, (rows, width), or (rows, width, N) of N runs at once, and how many passes were run.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, runner
    >>> x = cg.variable("x")
    >>> halve = Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))
    >>> run = runner(Program({"x": 1}, [halve], record=["x"]))
    >>> run.run(run.memory({"x": 8.0}), passes=4, every=2)
    Record(rows=array([[2. ],
           [0.5]]), passes=4)
    """

    rows: Array
    passes: int


class Runner(ABC):
    """A program ready to run; made by `runner`. It can `run` on a memory of all registers, `bind` one, and tell `text`.

    width: numbers in a vector of `Map`, to a multiple of which registers are padded.  size: numbers in a memory.
    shared: {register that all memories share: its numbers}, which may be changed between runs by who knows that they
    fit, or asks `program.check_shared`.

    >>> from cgraph.extend import Program, runner
    >>> run = runner(Program({"x": 1}, [], record=["x"]), "python")
    >>> run.read(run.memory({"x": 8.0}), "x").tolist()
    [8.0]
    """

    # Directions in a vector, and vectors in a block: odd, since rows a power of two apart would share few cache lines.
    lanes, vectors = 8, 513
    vector_cost = 1  # of an operation on a vector of directions, in operations on numbers

    def __init__(self, program: Program, width: int = 1) -> None:
        self.program, self.width = program, width
        places, self.size = layout(program.registers, program.shared, width)
        slices = {name: slice(places[name], places[name] + n) for name, n in program.registers.items()}
        self._slices = {name: place for name, place in slices.items() if name not in program.shared}
        self._all = aligned(places[""])
        self._all[:] = 0.0
        self.shared = {name: self._all[slices[name]] for name in program.shared}
        for name, numbers in program.shared.items():
            self.shared[name][:] = numbers

    @cached_property
    def masked(self) -> Program:
        """The program of memories side by side, see `many`."""
        return many(self.program)

    def memory(self, values: Mapping[str, ArrayLike], count: int | None = None) -> Array:
        """A memory, (size,) or (size, count), with these values of registers, 0 elsewhere.

        values: {register: a number or an array of its length, or (length, count)}.
        Raises GraphError for an unknown register or a value of another length.
        """
        memory = np.zeros(self.size if count is None else (self.size, require_whole("count", count)))
        for name, value in require_mapping("values", values, "register: numbers").items():
            self.write(memory, name, value)
        return memory

    def read(self, memory: Array, name: str) -> Array:
        """The register in a memory, a view (length,). Raises GraphError for an unknown one."""
        if not isinstance(name, str) or name not in self._slices:
            raise GraphError(f"the program has no register {name!r} (it has {', '.join(self._slices) or 'none'})")
        require_kind("memory", memory, np.ndarray)
        return memory[self._slices[name]]

    def write(self, memory: Array, name: str, value: ArrayLike) -> None:
        """Set a register. Raises GraphError for an unknown one, or a value of another length."""
        register = self.read(memory, name)
        try:
            numbers = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            numbers = real_array(f"register {name!r}", value)
        if numbers.ndim and numbers.shape != register.shape:
            raise GraphError(f"register {name!r} needs shape {register.shape}, got {numbers.shape}")
        register[...] = numbers

    def run(self, memory: Array, passes: int, every: int = 1, feed: ArrayLike | None = None) -> Record:
        """Run passes, fewer if the program stops, and record a row after each `every`th.

        memory: float64 (size,), changed in place: the next run continues from it. Or N memories (size, N), which run
        side by side in vectors, each as it does alone; rows of the record are then (rows, width, N).
        feed: (passes, feed_width), what the registers of the program's feed are before each pass; of N memories
        (passes, feed_width, N), or (passes, feed_width, 1) for all.
        Raises GraphError for a memory or a feed of another shape or type, or a number out of range; for N memories of a
        program with `record_if` or `stop`, or with statements that run one memory alone.
        """
        many = memory.shape[1:] if isinstance(memory, np.ndarray) and memory.ndim == 2 else ()
        require_memory("a memory", memory, (self.size, *many))
        require_whole("passes", passes)
        require_whole("every", every, 1)
        if many and (alone := self.program.alone):
            raise GraphError(f"programs with {', '.join(alone)} run one memory at a time, not side by side")
        shape = (passes, self.program.feed_width, *many)
        fed = np.empty(() if self.program.feed else shape) if feed is None else real_array("feed", feed)
        if fed.shape not in (shape, (*shape[:2], 1)[: len(shape)]):
            raise GraphError(f"the program needs a feed of shape {shape}, got {fed.shape}")
        return (self._run_many if many else self._run)(memory, passes, every, fed)

    def bind(self, memory: Array, rows: Array | None = None) -> Callable[..., None]:
        """A function of nothing: `run` on this memory, len(rows) passes, which writes the rows.

        Without rows a function of a number of passes, which records nothing. The arrays, float64 (size,) and
        (passes, width), are checked here and never again; the function keeps them alive. One thread at a time may call
        it; between calls registers may be written. A pass that records nothing leaves the last rows as they were.
        Raises GraphError for an array of another shape or type, or a program with a feed.
        """
        if self.program.feed:
            raise GraphError("a bound run takes no feed: give its registers a place in the memory")
        if rows is not None:
            passes = len(rows) if isinstance(rows, np.ndarray) and rows.ndim else 0
            require_memory("rows", rows, (passes, self.program.width))
        require_memory("a memory", memory, (self.size,))
        return self._bind(memory, rows)

    @abstractmethod
    def text(self, x: str) -> str:
        """What one pass from this register to the record is run as."""

    def lane_code(self, clock: str, results: Sequence[str] = (), *, alike: bool = True) -> LaneCode | None:
        """Machine code of memories in lanes; none in Python, with a feed, or of what runs alone.

        clock: a register of length 1.  results: registers that are read after a run.  alike: whether a memory has the
        bits that it has alone; else sines and such are those of vectors.
        """
        return None

    @abstractmethod
    def bind_pass(self, x: Register, y: Register) -> tuple[Callable[[], None], Registers]:
        """A function of nothing that runs a pass from one register to another, both in arrays; and the others."""

    @made_once
    def columns(self, name: str, start: Start = dict) -> tuple[int, Columns]:
        """As `columns_from`, kept for this start."""
        return self.columns_from(name, start)

    @abstractmethod
    def columns_from(self, name: str, start: Start) -> tuple[int, Columns]:
        """Points in a block, and the function that writes what is recorded of a pass from each of them, in columns."""

    @abstractmethod
    def _run(self, memory: Array, passes: int, every: int, feed: Array) -> Record: ...

    @abstractmethod
    def _run_many(self, memories: Array, passes: int, every: int, feed: Array) -> Record: ...

    @abstractmethod
    def _bind(self, memory: Array, rows: Array | None) -> Callable[..., None]: ...
