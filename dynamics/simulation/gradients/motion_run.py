"""Motion run: the steps of a motion, forward, and back or again along what was recorded of them, block by block."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cgraph.extend import Array, Runner, Tape, run_passes

from ..steps.dense_output import Indices
from ..steps.stepping import nonfinite, unsolved
from .motion import MotionError, MotionRequest
from .motion_programs import LOSS, Along, MotionPrograms

MOST_RECORDED = 128 * 2**20  # bytes of what is recorded of steps; of more, checkpoints are kept
PIECE = 4096  # passes between two looks at Python
FEW = 4  # directions: of fewer, iterations one after another are done sooner than a vector of them


class MotionRun:
    """A motion from its start to its end, once; then along it.

    tape: what is recorded of the steps.
    x: (m,), the end.  loss: the running loss.
    arrives: whether the last step is still to be fitted, by `tried`, and then made, by `finish`.
    Raises MotionError for a motion that does not stay finite, or whose equations are not solved; of motions side by
    side, such a one has an end that is not finite.
    """

    def __init__(
        self, motion: MotionRequest, programs: MotionPrograms, *, arrives: bool = False, every: int = 0
    ) -> None:
        """every: keep the states after every so many steps alone, of which nothing goes along the motion."""
        self.motion, self.start, self.step, self.failed = motion, programs.start, programs.step, programs.failed
        count, width = len(motion.h), self.step.forward.program.width
        fits = every > 0 or 8 * width * count * max(1, motion.many) <= MOST_RECORDED
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
        self.begin = forward.read(memory, passes.handed["x"]).copy()
        self._start_constants = {name: forward.read(memory, name).copy() for name in passes.constants}
        handed = self.step.passes.handed
        values = {handed.get(name, name): forward.read(memory, after).copy() for name, after in passes.handed.items()}
        return _memory(self.step.forward, {**given, **values}, motion.many)

    def tried(self) -> Array:
        """Where the last step arrives, (m,)."""
        count, memory = len(self.motion.h), self._memory.copy()
        self.step.forward.run(memory, 1, 1, _fed(self.motion, count - 1, count))
        return self.step.forward.read(memory, self.step.passes.handed["x"])

    def finish(self) -> None:
        """Make the last step."""
        count = len(self.motion.h)
        self.tape.run(self._memory, count - 1, count, PIECE, self._every)
        self._end()

    def _end(self) -> None:
        forward, handed, memory = self.step.forward, self.step.passes.handed, self._memory
        self.x = forward.read(memory, handed["x"]).copy()
        self.loss = forward.read(memory, handed[LOSS])[0].copy() if LOSS in handed else np.zeros(self.x.shape[1:])
        if (bad := self._bad(memory)).any():
            if not self.motion.many:
                raise MotionError(f"the motion {self.stopped()}")
            self.x[:, bad] = np.nan
        self._constants = {name: forward.read(memory, name).copy() for name in self.step.passes.constants}

    def _bad(self, memory: Array) -> Any:
        """Whether the steps so far left the numbers, or have equations that were not solved; () or (N,)."""
        forward, handed = self.step.forward, self.step.passes.handed
        bad = ~np.isfinite(forward.read(memory, handed["x"])).all(axis=0)
        return bad | (forward.read(memory, handed[self.failed])[0] != 0.0) if self.failed else bad

    def stopped(self, k: int | None = None) -> str:
        """Where a motion that went wrong, the k-th of many, did so: the first step after which it is, in words."""
        motion, forward, memory = self.motion, self.step.forward, self._begin()
        before, first, size = memory, 0, PIECE
        while first < len(motion.h):
            before, last = memory.copy(), min(first + size, len(motion.h))
            run_passes(forward, memory, last - first, last - first, _fed(motion, first, last))
            if not self._bad(memory)[() if k is None else k]:
                first = last
            elif last - first == 1:
                break
            else:
                memory, size = before, max(1, (last - first) // 16)
        x = forward.read(memory, self.step.passes.handed["x"])
        x = x if k is None else x[:, k]
        where, names = f"stopped at t = {motion.t[first + 1]:.6g} s", motion.problem.components
        if what := nonfinite(names, x):
            return f"{where}: {what}"
        old = forward.read(before, self.step.passes.handed["x"])
        return f"{where}: {unsolved(names, old if k is None else old[:, k], x)}"

    def states(self) -> tuple[Indices, Array]:
        """After how many steps (T,), and states (T, m), from the start to the end: all that are kept."""
        count, m = len(self.motion.h), len(self.x)
        blocks = self.tape.blocks
        if not self.tape.checkpoints:
            numbers = [np.arange(first + self._every, last + 1, self._every) for first, last, _ in blocks]
            # a row ends with the state after the step
            rows = [kept[:, -m:] for *_, kept in blocks]
            if not len(numbers[-1]) or numbers[-1][-1] != count:
                numbers, rows = [*numbers, np.array([count])], [*rows, self.x[None]]
            return np.concatenate([[0], *numbers]), np.concatenate([self.begin[None], *rows])
        kept = [self.step.forward.read(memory, self.step.passes.handed["x"]) for *_, memory in blocks]
        return np.array([*[first for first, *_ in blocks], count]), np.array([*kept, self.x])

    def pulled(self, seeds: Mapping[str, Array | float]) -> tuple[dict[str, Array], Array]:
        """Cotangents of the start and of the inputs, from those after the last step; and rows, those of each step."""
        memory = self._linear_memory(self.step, self._constants, seeds)
        back = self.step.back
        width, parts = back.program.feed_width, []
        for first, last, tape in self.tape.recorded(backwards=True):
            parts.append(run_passes(back, memory, last - first, 1, tape[::-1, :width]).rows)
        none = np.empty((len(self.motion.h), 0))
        rows = np.concatenate([part[::-1] for part in reversed(parts)]) if back.program.record else none
        bars = self._vectors(self.step, memory)
        if self.start is None:
            return bars, rows
        memory = self._linear_memory(self.start, self._start_constants, bars)
        run_passes(self.start.back, memory, 1, 1, self._start_tape)
        return self._vectors(self.start, memory), rows

    def last_slope(self, seed: Array) -> float:
        """The cotangent of h of the last step, from that of x after it."""
        memory = self._linear_memory(self.step, self._constants, {"x": seed})
        _, _, tape = next(self.tape.recorded(backwards=True))
        row = self.step.back.run(memory, 1, 1, tape[-1:, : self.step.back.program.feed_width]).rows[0]
        return float(row[self.step.passes.varied.index("h")])

    def pushed(self, directions: Mapping[str, Array], lengths: Array) -> tuple[Array, Array]:
        """States (steps + 1, m), and their tangents (steps + 1, m, k) along k directions of the start and inputs.

        lengths: (steps, k), tangents of the lengths of the steps; none where these are constants.
        """
        back, names = self.step.back, self.step.linear.vectors
        if self.start is not None:
            memory = self._linear_memory(self.start, self._start_constants, directions)
            _run_all(self.start.back, memory, self._start_tape)
            directions = {**directions, **self._vectors(self.start, memory)}
        memory = self._linear_memory(self.step, self._constants, directions)
        m, width = len(self.x), back.program.feed_width
        states, tangents = [self.begin[None]], [back.read(memory, names["x"])[None].copy()]
        changes = set((np.flatnonzero((np.diff(lengths, axis=0) != 0.0).any(axis=1)) + 1).tolist())
        for first, last, tape in self.tape.recorded(backwards=False):
            states.append(tape[:, -m:])
            for begin, end in itertools.pairwise([first, *[k for k in range(first + 1, last) if k in changes], last]):
                if len(lengths):
                    back.write(memory, names["h"], lengths[None, begin])
                tangents.append(_run_all(back, memory, tape[begin - first : end - first, :width]))
        self._vectors(self.step, memory)
        return np.concatenate(states), np.concatenate(tangents)

    def _linear_memory(
        self, along: Along, constants: Mapping[str, Array], vectors: Mapping[str, Array | float]
    ) -> Array:
        names = along.linear.vectors
        placed = {names[name]: np.asarray(vector) for name, vector in vectors.items() if name in names}
        many = [vector.shape[1] for vector in placed.values() if vector.ndim == 2]
        return _memory(along.back, {**constants, **placed}, max(many, default=0))

    def _vectors(self, along: Along, memory: Array) -> dict[str, Array]:
        unsolved = along.back.read(memory, along.linear.unsolved)[0] != 0.0
        if unsolved.any() and (unsolved & np.isfinite(self.x).all(axis=0) if self.motion.many else unsolved).any():
            raise MotionError("the equations of a step's derivative were not solved: the step is too long")
        return {name: along.back.read(memory, register).copy() for name, register in along.linear.vectors.items()}


def _run_all(ready: Runner, memories: Array, feed: Array) -> Array:
    """The rows (passes, width, k) of k memories that are fed the same."""
    if ready.masked is ready.program or memories.shape[1] >= FEW:
        return run_passes(ready, memories, len(feed), 1, feed).rows
    rows = np.empty((len(feed), ready.program.width, memories.shape[1]))
    for k in range(memories.shape[1]):
        memory = memories[:, k].copy()
        rows[:, :, k] = ready.run(memory, len(feed), 1, feed).rows
        memories[:, k] = memory
    return rows


def _memory(ready: Runner, values: Mapping[str, Array], many: int) -> Array:
    """A memory, or many, with those of the values that the program has registers for; a vector is that of all."""
    known = {name: value for name, value in values.items() if name in ready.program.registers}
    if not many:
        return ready.memory(known)
    wide = {
        name: value if value.ndim != 1 else np.repeat(value[:, None], many, axis=1) for name, value in known.items()
    }
    return ready.memory(wide, many)


def _fed(motion: MotionRequest, first: int, last: int) -> Array:
    """What the steps first .. last - 1 are fed."""
    tau = motion.tau[first:last] if motion.each_step else np.empty((last - first, 0))
    rows = np.empty((last - first, 2 + tau.shape[1], *tau.shape[2:]))
    rows[:, 0].T[...], rows[:, 1].T[...], rows[:, 2:] = motion.t[first:last], motion.h[first:last], tau
    return rows
