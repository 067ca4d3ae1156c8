"""Motion run: the steps of a motion, forward, and back or again along what was recorded of them, block by block."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cgraph._shared import Array, Tape, run_passes
from cgraph.extend import Runner

from ..outcome import MotionError
from ..stepper import nonfinite, unsolved
from ..steps.dense_output import Indices
from .motion import MotionRequest
from .motion_programs import LOSS, MotionPrograms, WithDerivative

MOST_RECORDED = 128 * 2**20  # bytes of what is recorded of steps; of more, checkpoints are kept
PIECE = 4096  # passes between two looks at Python
FEW_DIRECTIONS = 4  # directions: of fewer, iterations one after another are done sooner than a vector of them


class MotionRun:
    """N motions from their starts to their ends, once; then along them.

    tape: what is recorded of the steps.
    x: (m, N), the ends.  loss: the running loss, (N,).
    arrives: whether the last step is still to be fitted, by `tried`, and then made, by `finish`.
    Raises MotionError for a motion alone that does not stay finite, or whose equations are not solved; one side by side
    with others has an end that is not finite.
    """

    def __init__(
        self, motion: MotionRequest, programs: MotionPrograms, *, arrives: bool = False, every: int = 0
    ) -> None:
        """every: keep the states after every so many steps alone, of which nothing goes along the motion."""
        self.motion, self.start, self.step, self.failed = motion, programs.start, programs.step, programs.failed
        count, width = len(motion.h), self.step.forward.program.width
        fits = every > 0 or 8 * width * count * motion.many <= MOST_RECORDED
        self._every = every or 1
        self.tape = Tape(self.step.forward, partial(_fed, motion), 0 if fits else math.ceil(math.sqrt(count)))
        self._memory = self._begin()
        self.tape.run(self._memory, 0, count - arrives, PIECE, self._every)
        if not arrives:
            self._end()

    def _begin(self) -> Array:
        """The memory before the first step."""
        motion, start = self.motion, self.start
        given = {"t": motion.t[:1], **motion.parameters_at(motion.force_at_start)}
        if motion.method.adaptive and not self.failed:  # rtol = 0: what is iterated is solved to rounding
            given |= {"rtol": np.asarray(motion.options.relative), "atol": np.asarray(motion.options.absolute)}
        if start is None:
            self.begin = motion.x
            return _memory(self.step.forward, {**given, self.step.passes.handed["x"]: motion.x}, motion.many)
        passes, forward = start.passes, start.forward
        memory = _memory(forward, {**given, passes.handed["x"]: motion.x}, motion.many)
        rows = run_passes(forward, memory, 1, 1, np.empty((1, 0))).rows
        self._start_tape = rows[:, : start.linear.program.feed_width]
        self.begin = _read(forward, memory, passes.handed["x"])
        self._start_constants = {name: _read(forward, memory, name) for name in passes.constants}
        handed = self.step.passes.handed
        values = {handed.get(name, name): _read(forward, memory, after) for name, after in passes.handed.items()}
        return _memory(self.step.forward, {**given, **values}, motion.many)

    def tried(self) -> Array:
        """State at which the last step arrives, (m, 1)."""
        count, memory = len(self.motion.h), self._memory.copy()
        self.step.forward.run(memory, 1, 1, _fed(self.motion, count - 1, count))
        return self._state(memory)

    def finish(self) -> None:
        """Make the last step."""
        count = len(self.motion.h)
        self.tape.run(self._memory, count - 1, count, PIECE, self._every)
        self._end()

    def _state(self, memory: Array) -> Array:
        """(m, N)."""
        return _read(self.step.forward, memory, self.step.passes.handed["x"])

    def _end(self) -> None:
        forward, handed, memory = self.step.forward, self.step.passes.handed, self._memory
        self.x = self._state(memory)
        self.loss = _read(forward, memory, handed[LOSS])[0] if LOSS in handed else np.zeros(self.motion.many)
        if (bad := self._bad(memory)).any():
            if self.motion.many == 1:
                raise MotionError(f"the motion {self.stopped(0)}")
            self.x[:, bad] = np.nan
        self._constants = {name: _read(forward, memory, name) for name in self.step.passes.constants}

    def _bad(self, memory: Array) -> Any:
        """Whether the steps so far left the numbers, or have equations that were not solved, (N,)."""
        bad = ~np.isfinite(self._state(memory)).all(axis=0)
        if self.failed:
            bad |= _read(self.step.forward, memory, self.step.passes.handed[self.failed])[0] != 0.0
        return bad

    def stopped(self, k: int) -> str:
        """Place where motion k went wrong: the first step after which it has, in words."""
        motion, forward, memory = self.motion, self.step.forward, self._begin()
        before, first, size = memory, 0, PIECE
        while first < len(motion.h):
            before, last = memory.copy(), min(first + size, len(motion.h))
            run_passes(forward, memory, last - first, last - first, _fed(motion, first, last))
            if not self._bad(memory)[k]:
                first = last
            elif last - first == 1:
                break
            else:
                memory, size = before, max(1, (last - first) // 16)
        x, names = self._state(memory)[:, k], motion.problem.components
        what = nonfinite(names, x) or unsolved(names, self._state(before)[:, k], x)
        return f"stopped at t = {motion.t[first + 1]:.6g} s: {what}"

    def states(self) -> tuple[Indices, Array]:
        """After how many steps (T,), and states (T, m, N), from the start to the end: all that are kept."""
        count, m, blocks = len(self.motion.h), len(self.x), self.tape.blocks
        if self.tape.checkpoints:
            kept = [self._state(memory) for *_, memory in blocks]
            return np.array([*[first for first, *_ in blocks], count]), np.array([*kept, self.x])
        numbers = [np.arange(first + self._every, last + 1, self._every) for first, last, _ in blocks]
        # a row ends with the state after the step
        rows = [kept[:, -m:].reshape(len(kept), m, self.motion.many) for *_, kept in blocks]
        if not len(numbers[-1]) or numbers[-1][-1] != count:
            numbers, rows = [*numbers, np.array([count])], [*rows, self.x[None]]
        return np.concatenate([[0], *numbers]), np.concatenate([self.begin[None], *rows])

    def pulled(self, seeds: Mapping[str, Array | float]) -> tuple[dict[str, Array], Array]:
        """Cotangents of the start and of the inputs, from those after the last step; and rows, those of each step.

        (.., N), and rows (steps, .., N).
        """
        many = self.motion.many
        memory = _linear_memory(self.step, self._constants, seeds, many)
        pullback = self.step.derivative
        width, parts = pullback.program.feed_width, []
        for first, last, tape in self.tape.recorded(backwards=True):
            rows = run_passes(pullback, memory, last - first, 1, tape[::-1, :width]).rows
            parts.append(rows.reshape(*rows.shape[:2], many)[::-1])
        none = np.empty((len(self.motion.h), 0, many))
        rows = np.concatenate(parts[::-1]) if pullback.program.record else none
        bars = self._vectors(self.step, memory)
        if self.start is None:
            return bars, rows
        memory = _linear_memory(self.start, self._start_constants, bars, many)
        run_passes(self.start.derivative, memory, 1, 1, self._start_tape)
        return self._vectors(self.start, memory), rows

    def last_slope(self, seed: Array) -> float:
        """Cotangent of h of the last step of one motion, from the cotangent of x (m, 1) after the step."""
        memory = _linear_memory(self.step, self._constants, {"x": seed}, 1)
        _, _, tape = next(self.tape.recorded(backwards=True))
        row = self.step.derivative.run(memory, 1, 1, tape[-1:, : self.step.derivative.program.feed_width]).rows[0]
        return float(row[self.step.passes.varied.index("h")])

    def pushed(self, directions: Mapping[str, Array], lengths: Array) -> tuple[Array, Array]:
        """States (steps + 1, m) of one motion, and tangents (steps + 1, m, k) along k directions of start and inputs.

        lengths: (steps, k), tangents of the lengths of the steps; none where these are constants.
        """
        push, names, many = self.step.derivative, self.step.linear.vectors, directions["x"].shape[1]
        if self.start is not None:
            memory = _linear_memory(self.start, self._start_constants, directions, many)
            _run_all(self.start.derivative, memory, self._start_tape)
            directions = {**directions, **self._vectors(self.start, memory)}
        memory = _linear_memory(self.step, self._constants, directions, many)
        m, width = len(self.x), push.program.feed_width
        states, tangents = [self.begin.T], [_read(push, memory, names["x"])[None]]
        changes = set((np.flatnonzero((np.diff(lengths, axis=0) != 0.0).any(axis=1)) + 1).tolist())
        for first, last, tape in self.tape.recorded(backwards=False):
            states.append(tape[:, -m:])
            for begin, end in itertools.pairwise([first, *[k for k in range(first + 1, last) if k in changes], last]):
                if len(lengths):
                    push.read(memory, names["h"])[...] = lengths[begin]
                rows = _run_all(push, memory, tape[begin - first : end - first, :width])
                tangents.append(rows.reshape(end - begin, m, many))
        self._vectors(self.step, memory)
        return np.concatenate(states), np.concatenate(tangents)

    def _vectors(self, of: WithDerivative, memory: Array) -> dict[str, Array]:
        """The tangents or cotangents in a memory, (.., N) or (.., k)."""
        unsolved = _read(of.derivative, memory, of.linear.unsolved)[0] != 0.0
        if (unsolved & np.isfinite(self.x).all(axis=0)).any():
            raise MotionError("the equations of a step's derivative were not solved: the step is too long")
        return {name: _read(of.derivative, memory, register) for name, register in of.linear.vectors.items()}


def _run_all(ready: Runner, memories: Array, feed: Array) -> Array:
    """The rows (passes, width, k) of k memories that are fed the same."""
    if memories.ndim == 1 or ready.masked is ready.program or memories.shape[1] >= FEW_DIRECTIONS:
        return run_passes(ready, memories, len(feed), 1, feed).rows
    rows = np.empty((len(feed), ready.program.width, memories.shape[1]))
    for k in range(memories.shape[1]):
        memory = memories[:, k].copy()
        rows[:, :, k] = ready.run(memory, len(feed), 1, feed).rows
        memories[:, k] = memory
    return rows


def _linear_memory(
    of: WithDerivative, constants: Mapping[str, Array], vectors: Mapping[str, Array | float], many: int
) -> Array:
    """The memory of a derivative, or of many: of one motion along one or many directions, or of many."""
    names = of.linear.vectors
    placed = {names[name]: np.asarray(vector) for name, vector in vectors.items() if name in names}
    return _memory(of.derivative, {**constants, **placed}, many)


def _memory(ready: Runner, values: Mapping[str, Array], many: int) -> Array:
    """A memory, or many, with those of the values, (k, N) or for all (k,), that the program has registers for."""
    memory = ready.memory({}, None if many == 1 else many)
    for name, value in values.items():
        if name in ready.program.registers:
            register = ready.read(memory, name).reshape(-1, many)
            register[...] = value[:, None] if value.ndim == 1 else value
    return memory


def _read(ready: Runner, memory: Array, name: str) -> Array:
    """The register in a memory, or in many, a copy (k, N)."""
    register = ready.read(memory, name).copy()
    return register[:, None] if register.ndim == 1 else register


def _fed(motion: MotionRequest, first: int, last: int) -> Array:
    """Inputs of the steps first .. last - 1, (.., width), or (.., width, N) where motions have their own forces."""
    steps = slice(first, last)
    if not motion.each_step:
        return np.stack([motion.t[steps], motion.h[steps]], axis=1)
    rows = np.empty((last - first, 2 + motion.forces, motion.many))
    rows[:, 0].T[...], rows[:, 1].T[...], rows[:, 2:] = motion.t[steps], motion.h[steps], motion.tau[steps]
    return rows[:, :, 0] if motion.many == 1 else rows
