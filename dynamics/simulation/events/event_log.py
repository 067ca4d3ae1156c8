"""EventLog: the events of a run, block by block, and the run that ends or restarts where one happens."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ...integrators.step_control import RESOLUTION
from ..estimates.state_sizes import Flags
from ..row_values import converted
from ..run_options import RunOptions
from ..steps.dense_output import UNIT, StepBlock
from ..steps.stepping import Integration
from ..trajectory import Crossings
from .event import EventProgram
from .event_cells import MOST_CELLS, WatchedSteps
from .event_location import Crossing, Side, crossings

STEPS = 512  # looked at together
ROUNDED = 3.0  # times a state, until it is read: at both ends of a step and between
AT_ONCE = 32  # restarts of the run in a row, at one instant or of contacts that rest
RESETS = 10_000  # one after another before a restart: more than bodies that touch need to come apart
MISSED = (
    "may have been missed, first after t = {:.6g} s: its quantity turns too often for "
    f"{MOST_CELLS} looks in a step; shorter steps (max_step or dt) find all"
)
UNSIDED = (
    "starts at zero and leaves it at t = {:.6g} s, where nothing is reset: it has no direction, which would tell on "
    "which side it starts"
)

Happening = tuple[int, float, Array]  # number of the event, time, state
Found = tuple[int, float, int, Crossing]  # step, share of it, number of the event, what its quantity does


class _Zeros(NamedTuple):
    """Quantities at zero at an instant, the values of all, and the motions of these, (k,)."""

    at: Flags
    values: Array
    motions: Array


class EventLog:
    """The events of a run, (number, t, x) each in `happened`.

    ended: the event that has ended the run, in words.  status: why a reset has stopped it.
    parameters: of the rate, those of the block that is to come.
    restart: (t, x, x_new), the state that was reset and the one to go on from, else None.
    warnings: a sentence for each event of which some may have been missed.
    """

    def __init__(self, program: EventProgram) -> None:
        self.program = program
        self.parameters: Sequence[float] = ()
        self.ended = self.status = ""
        self.restart: tuple[float, Array, Array] | None = None
        self.warnings: list[str] = []
        self.happened: list[Happening] = []
        self._sides: list[Side] = []  # none before the first step
        self._from = np.array([-float(event.direction) for event in program.events])  # sides, see `Crossing`
        self._steps = 0
        self._sizes, self._ways = np.zeros((2, 2, len(program.components)))  # of states and rates: largest, and path
        self._done: set[int] = set()  # events that happen again only after they have not been due
        self._missed: set[int] = set()
        self._reset_at, self._restarts = math.nan, 0  # the instant, and how many in a row from which nothing got away
        self._last: StepBlock | None = None

    def __call__(self, block: StepBlock) -> StepBlock:
        """Note the events of these steps. The steps up to the event after which the run ends or restarts, or all."""
        for first in range(0, len(block.t), STEPS):
            part = block.part(slice(first, first + STEPS))
            if stop := self._note(part, self._found(part)):
                row, s, t, x = stop
                return block.part(slice(first + row + (s > 0.0))).ending(t, x)
            self._see(part, len(part.t), part.x[-1])
            self._last = part.part(slice(-1, None))
        return block

    def finish(self) -> None:
        """The run is at its end: what is zero there to the last bit has arrived."""
        if self._last is not None:
            sides = enumerate(self._sides)
            waiting = {number: Crossing(0, 1.0, side.sign, touching=False) for number, side in sides if side.waiting}
            self._happen(self._last, float(self._last.t[0]), self._last.x[0], waiting)

    def _found(self, part: StepBlock) -> list[Found]:
        """Crossings in these steps, in order."""
        found: list[Found] = []
        self._see(part, 0, part.x_old[0])
        self._sides = self._sides or [self._start(number, part) for number in range(len(self.program.events))]
        for number, side in enumerate(self._sides):
            noise = self._noise(number, float(part.t[-1]), part.x[-1]) if side.resting else 0.0
            steps = WatchedSteps(self.program.events[number], self.parameters, part, noise)
            some, beyond = crossings(steps, side)
            found += [(one.row, one.s, number, one) for one in some]
            if beyond.any() and number not in self._missed:
                self._missed.add(number)
                self._warn(number, MISSED.format(part.t_old[np.argmax(beyond)]))
        return sorted(found)

    def _start(self, number: int, part: StepBlock) -> Side:
        """Side at the start of the run: zero, to rounding, is rest; with a reset, the side to come from."""
        event, t, x = self.program.events[number], part.t_old[:1], part.x_old[:1]
        value = float(event.value(t, x, self.parameters)[0])
        if not abs(value) <= self._noise(number, float(t[0]), x[0]):
            return Side(float(np.sign(value)))
        return Side(0.0 if event.reset is None else float(self._from[number]), left=0.0)

    def _note(self, part: StepBlock, found: Sequence[Found]) -> tuple[int, float, float, Array] | None:
        """Add these events. (step, share, t, x) of those after which the run does not go on."""
        if not found:
            return None
        rows, s = np.array([one[0] for one in found]), np.array([one[1] for one in found])
        times, states = part.times_at(rows, s).tolist(), part.states_at(rows, s)
        for (row, share), group in itertools.groupby(range(len(found)), lambda k: found[k][:2]):
            together = list(group)
            t, x = times[together[0]], states[together[0]]
            if self._happen(part.part(slice(row + 1)), t, x, {found[k][2]: found[k][3] for k in together}):
                return row, share, t, x
        return None

    def _see(self, part: StepBlock, steps: int, x: Array) -> None:
        """The run came to x by the first steps of a part: how far its states have gone, and how many roundings old."""
        self._steps += steps
        states = np.vstack([part.x_old[:steps], x])
        times = np.append(part.t_old[:steps], part.t_old[0] if steps == 0 else part.t[steps - 1])
        for k, values in enumerate((states, self.program.rates(times, states, self.parameters))):
            values = np.where(np.isfinite(values), values, 0.0)
            np.fmax(self._sizes[k], np.abs(values).max(axis=0), out=self._sizes[k])
            self._ways[k] += np.abs(np.diff(values, axis=0)).sum(axis=0)

    def _happen(self, part: StepBlock, t: float, x: Array, arrived: Mapping[int, Crossing]) -> bool:
        """Note what reaches zero at an instant of the last of these steps; whether that ends or resets the run."""
        events = self.program.events
        new = [n for n, one in arrived.items() if one.side and events[n].counts(one.side, touching=one.touching)]
        ends = [number for number in new if events[number].terminal]
        restarts = not ends and any(events[number].reset for number in new)
        step = part.part(slice(-1, None))
        if restarts:  # another reset may move what only the next step would find at zero
            self._see(part, len(part.t), x)
            before = self._zeros(step, float(step.t_old[0]), step.x_old[0])
            self._from = np.where(before.at, self._from, np.sign(before.values))
        for number, one in arrived.items():
            if one.side:
                self._from[number] = one.side
            elif events[number].reset is not None:
                self._warn(number, UNSIDED.format(t))
        if restarts:
            self._restart(step, t, x, {number: arrived[number] for number in new}, before.at)
            return True
        self.happened += [(number, t, x) for number in new]
        self._done |= {*new}
        self.ended = self._ended(ends[0], t) if ends else ""
        return bool(ends)

    def _restart(self, step: StepBlock, t: float, x: Array, new: Mapping[int, Crossing], rested: Flags) -> None:
        """Reset the state by these events, one at a time, and by those that are due after a reset.

        Due is what is zero and moves to the other side than it has come from; what touches, once. Events without a
        reset, which see the state as it comes, are first.  rested: what was at zero at the start of the step.
        """
        events, arrived, resets, zeros = self.program.events, x, list[int](), self._zeros(step, t, x)
        back = rested & zeros.at & (zeros.motions * self._from > 0.0)  # has not really left
        touching = {number for number, one in new.items() if one.touching}
        due = touching | {number for number in new if not back[number]}
        while len(resets) <= RESETS and np.isfinite(x).all():
            moves = zeros.motions * np.where(self._from == 0.0, -np.sign(zeros.motions), self._from) < 0.0
            leaving = {n for n in np.flatnonzero(zeros.at & moves).tolist() if events[n].counts(self._from[n])}
            self._done &= leaving
            if resets:
                due = (due & touching) | (leaving - self._done)
            if not due:
                break
            number = min(due, key=lambda number: (events[number].reset is not None, number))
            due = due - {number}
            self._done.add(number)
            self._from[number] = self._from[number] or -np.sign(zeros.motions[number])
            self.happened.append((number, t, x))
            if events[number].terminal:
                self.ended = self._ended(number, t)
                break
            if events[number].reset is not None:
                resets.append(number)
                x = self.program.reset(number, t, x, self.parameters)
                zeros = self._zeros(step, t, x)
        again = all(one.resting for one in new.values()) or abs(t - self._reset_at) <= RESOLUTION * abs(t)
        self._restarts = self._restarts + 1 if again else 0
        self._reset_at, self.restart = t, (t, arrived, x)
        names = [f"{events[number].name!r}" for number in sorted({*(resets[-AT_ONCE:] or new)})]
        which = f"event {names[0]} resets" if len(names) == 1 else f"events {', '.join(names)} reset"
        if len(bad := np.flatnonzero(~np.isfinite(x))):
            what = (
                f"{self.program.components[bad[0]]} is {x[bad[0]]} after the reset of event {events[resets[-1]].name!r}"
            )
            self.status = f"stopped at t = {t:.6g} s: {what}"
        elif len(resets) > RESETS or self._restarts > AT_ONCE:
            self.status = (
                f"stopped at t = {t:.6g} s: {which} the state again and again at this instant; "
                "a contact that stays needs other equations from here on"
            )
        self._from = np.where(zeros.at & (zeros.motions != 0.0), np.sign(zeros.motions), self._from)
        self._sides = [self._side(number, zeros) for number in range(len(events))]

    def _side(self, number: int, zeros: _Zeros) -> Side:
        """Side after a reset: of a quantity at zero that to which it moves, or rest."""
        if not zeros.at[number]:
            return Side(float(np.sign(zeros.values[number])))
        motion = float(np.sign(zeros.motions[number]))
        return Side(left=motion) if motion else Side(float(self._from[number]), left=0.0)

    def _zeros(self, step: StepBlock, t: float, x: Array) -> _Zeros:
        """The quantities at an instant of a step, also after resets there."""
        at, states, p = np.array([t]), x[None], self.parameters
        values = np.array([event.value(at, states, p)[0] for event in self.program.events])
        zero = np.abs(values) <= np.array([self._noise(number, t, x, step.x) for number in range(len(values))])
        motions = self.program.motions(zero, at, states, p, self._gone[1:], self._roundings)
        return _Zeros(zero, values, motions * np.sign(step.h[0]))

    @property
    def _roundings(self) -> float:
        """Rounding errors of states by now, relative to how far they have gone.

        Roundings of steps add up at random; a rate that is off takes its state off by that share of the whole way.
        """
        return UNIT * ROUNDED * math.sqrt(1.0 + self._steps)

    @property
    def _gone(self) -> Array:
        """Distances that states and their rates have gone, (2, m), at least their sizes."""
        return np.fmax(self._sizes, self._ways)

    def _noise(self, number: int, t: float, x: Array, end: Array | float = 0.0) -> float:
        """Error of a quantity by the rounding of states, also inside a step to an end (1, m)."""
        errors = self._roundings * self._gone[:1] + UNIT * np.abs(end), np.array([self._roundings * abs(t)])
        return float(self.program.events[number].error(np.array([t]), x[None], self.parameters, *errors)[0])

    def _ended(self, number: int, t: float) -> str:
        return f"event {self.program.events[number].name!r} at t = {t:.6g} s"

    def _warn(self, number: int, what: str) -> None:
        self.warnings.append(f"event {self.program.events[number].name!r} {what}")


def split_crossings(
    program: EventProgram, happened: Sequence[Happening], nq: int, parameters: ArrayLike = 0.0
) -> dict[str, Crossings]:
    """Crossings by the event's name, from (number, t, x), with states split after nq numbers into q and qd."""
    result = {}
    for number, event in enumerate(program.events):
        matching = [(t, x) for k, t, x in happened if k == number]
        times = np.array([t for t, _ in matching])
        states = np.array([x for _, x in matching]).reshape(len(matching), len(program.components))
        states = converted(program.velocities, times, states, parameters)
        result[event.name] = Crossings(times, states[:, :nq], states[:, nq:])
    return result


class WatchedIntegration(Integration):
    """A run with events, in segments: each starts where the options say, or from the state that a reset leaves.

    segment: makes the integration of a segment from its options.
    """

    def __init__(
        self, segment: Callable[[RunOptions], Integration], options: RunOptions, program: EventProgram
    ) -> None:
        super().__init__(program.components)
        self._make, self.options, self.log = segment, options, EventLog(program)
        self._segments: list[Integration] = []

    @property
    def segment(self) -> Integration:
        """The part of the run that it is in: what makes its steps since the last reset."""
        return self._segments[-1]

    @property
    def resetting(self) -> bool:
        """Whether there are events that reset the state."""
        return any(event.reset is not None for event in self.log.program.events)

    def beside(self, dt: float) -> WatchedIntegration:
        """Run by other equal steps, which meet its end alone."""
        options = replace(self.options, dt=dt, t_eval=None, max_steps=math.inf)
        return WatchedIntegration(self._make, options, self.log.program)

    def crossings(self, nq: int, parameters: ArrayLike = 0.0) -> dict[str, Crossings]:
        """Crossings by the event's name, with states split after nq numbers; parameters: of the problem."""
        return split_crossings(self.log.program, self.log.happened, nq, parameters)

    def blocks(self, x: Array) -> Iterator[StepBlock]:
        """The steps from x (m,) on, some at a time. A reset is a step of no length."""
        options, log = self.options, self.log
        while True:
            yield from self._segment(options, x)
            if self.status or log.restart is None:
                return
            (t, before, x_new), log.restart = log.restart, None
            self.resets = sum(log.program.events[number].reset is not None for number, _, _ in log.happened)
            instant = np.array([t])
            yield StepBlock(instant, x_new[None], instant, np.zeros(1), before[None], np.zeros((1, 1, len(x))))
            if self.event or t == options.t_end:
                return
            options, x = self._rest(t), x_new

    def _segment(self, options: RunOptions, x: Array) -> Iterator[StepBlock]:
        """The steps up to an event after which the run does not go on as it did, or to the end."""
        run, log, last = self._make(options), self.log, options.t0
        self._segments.append(run)
        rejected, evaluations = self.rejected, self.evaluations
        for block in run.blocks(x):
            log.parameters = run.parameters
            kept = log(run.with_dense(block))
            self.steps += len(kept.t)
            self._count(run, rejected, evaluations)
            if len(kept.t):
                last = float(kept.t[-1])
                yield kept
            if log.ended or log.restart is not None:
                break
        else:
            self._count(run, rejected, evaluations)
            self.status = run.status
            if run.status and self.steps + self.rejected >= self.options.max_steps:
                self.status = self.too_many(last, self.options.max_steps)
            if not run.status:
                log.finish()
        self.status, self.event = log.status or self.status, log.ended

    def _count(self, run: Integration, rejected: int, evaluations: int) -> None:
        self.rejected, self.evaluations = rejected + run.rejected, evaluations + run.evaluations
        self.jacobians = sum(segment.jacobians for segment in self._segments)
        self.factorizations, self.prices = sum(segment.factorizations for segment in self._segments), run.prices
        self.largest, self.stiff = max(self.largest, run.largest), self.stiff or run.stiff
        self.slope = run.slope
        self.warnings = list(dict.fromkeys([*self.warnings, *run.warnings, *self.log.warnings]))

    def _rest(self, t: float) -> RunOptions:
        """The options of the rest of the run from t on, whose first step is chosen anew."""
        options, times = self.options, self.options.times
        if times is not None:
            ahead = times[(times - t) * options.direction > 0.0]
            times = ahead if len(ahead) else np.array([options.t_end])
        left = max(1.0, options.max_steps - self.steps - self.rejected)
        return replace(options, t0=t, t_eval=times, first_step=None, max_steps=left)
