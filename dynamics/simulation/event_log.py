"""EventLog: the events of a run, block by block, whether one ends it, and the state from which one restarts it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array

from ..integrators.step_control import RESOLUTION
from .dense_output import StepBlock, with_hermite
from .event_cells import MOST, WatchedSteps
from .event_location import Side, crossings, start_side
from .event_program import EventProgram
from .row_values import converted
from .trajectory import Crossings

STEPS = 512  # looked at together
AT_ONCE = 32  # resets at one instant: more than the impacts of a few bodies that touch


Happening = tuple[int, float, Array]  # number of the event, time, state


class EventLog:
    """The events of a run, (number, t, x) each in `happened`.

    ended: the event that has ended the run, in words.  status: why a reset has stopped it.
    parameters: of the rate, those of the block that is to come.
    restart: (t, x) to go on from after a reset, else None.
    warnings: a sentence for each event of which some may have been missed.
    """

    def __init__(self, program: EventProgram) -> None:
        self.program = program
        self.parameters: Sequence[float] = ()
        self.ended = self.status = ""
        self.restart: tuple[float, Array] | None = None
        self.warnings: list[str] = []
        self.happened: list[Happening] = []
        self._sides: list[Side] = []  # none before the first step, or the first after a reset
        self._reached: dict[int, float] = {}  # events that have just reset the state, and the side they came from
        self._missed: set[int] = set()
        self._reset_at, self._resets = np.nan, 0  # the instant, to rounding, and how many there in a row
        self._end: tuple[float, Array] | None = None

    def __call__(self, block: StepBlock) -> StepBlock:
        """Note the events of these steps. The steps up to the event after which the run ends or restarts, or all."""
        dense = with_hermite(block, self.program.rate, self.parameters) if block.dense is None else block
        for first in range(0, len(block.t), STEPS):
            part = dense.part(slice(first, first + STEPS))
            if stop := self._note(part, self._found(part)):
                t, x = self.happened[-1][1:]
                return dense.part(slice(first + stop[0] + (stop[1] > 0.0))).ending(t, x)
            self._end = float(part.t[-1]), part.x[-1]
        return dense

    def finish(self) -> None:
        """The run is at its end: what is zero there to the last bit has arrived."""
        if self._end is None:
            return
        waiting = [(number, side.sign < 0.0) for number, side in enumerate(self._sides) if side.waiting]
        counting = [(number, rising) for number, rising in waiting if self.program.events[number].counts(rising)]
        self._happen(*self._end, counting)

    def _found(self, part: StepBlock) -> list[tuple[int, float, int, bool]]:
        """(step, share of it, number of the event, whether it comes from below), in order."""
        found = []
        watched = [WatchedSteps(event, self.parameters, part) for event in self.program.events]
        if not self._sides:
            self._sides = [self._start(number, steps) for number, steps in enumerate(watched)]
        for number, (steps, side) in enumerate(zip(watched, self._sides, strict=True)):
            some, beyond = crossings(steps, side)
            found += [(one.row, one.s, number, one.rising) for one in some]
            if beyond.any() and number not in self._missed:
                self._missed.add(number)
                self._warn(number, float(part.t_old[np.argmax(beyond)]))
        return sorted(found)

    def _start(self, number: int, steps: WatchedSteps) -> Side:
        """On which side an event starts: after a reset by it, on the one to which its quantity moves."""
        if not self._reached:
            return start_side(steps)
        if number not in self._reached:
            return Side()
        block = steps.block
        slope = self.program.motion(number, float(block.t_old[0]), block.x_old[0], self.parameters) * block.h[0]
        return Side(left=float(np.sign(slope)) or self._reached[number])

    def _note(self, part: StepBlock, found: Sequence[tuple[int, float, int, bool]]) -> tuple[int, float] | None:
        """Add these events. (step, share) of the one after which the run does not go on, with those of its instant."""
        if not found:
            return None
        rows, s = np.array([one[0] for one in found]), np.array([one[1] for one in found])
        times, states = part.times_at(rows, s).tolist(), part.states_at(rows, s)
        for _, group in itertools.groupby(range(len(found)), lambda k: found[k][:2]):
            together = list(group)
            first = together[0]
            if self._happen(times[first], states[first], [found[k][2:] for k in together]):
                return found[first][0], found[first][1]
        return None

    def _happen(self, t: float, x: Array, events: Sequence[tuple[int, bool]]) -> bool:
        """Note events, (number, whether it comes from below), of one instant; whether one ends or resets the run."""
        self.happened += [(number, t, x) for number, _ in events]
        for number, _ in events:
            if self.program.events[number].terminal:
                self.ended = f"event {self.program.events[number].name!r} at t = {t:.6g} s"
                return True
        before = self._reached
        reached = {number: -1.0 if rising else 1.0 for number, rising in events if self.program.events[number].reset}
        if not reached:
            return False
        motions = {number: self.program.motion(number, t, x, self.parameters) for number in reached}
        lost = any(number in before and motions[number] * side > 0.0 for number, side in reached.items())  # in rounding
        self._reached = reached
        for number in reached:
            x = self.program.reset(number, t, x, self.parameters)
        name = self.program.events[max(reached)].name
        if len(bad := np.flatnonzero(~np.isfinite(x))):
            component = self.program.components[bad[0]]
            self.status = f"stopped at t = {t:.6g} s: {component} is {x[bad[0]]} after the reset of event {name!r}"
        self._resets = self._resets + 1 if abs(t - self._reset_at) <= RESOLUTION * abs(t) else 0
        if self._resets > AT_ONCE or lost:
            self.status = (
                f"stopped at t = {t:.6g} s: event {name!r} resets the state again and again at this instant; "
                "a contact that stays needs other equations from here on"
            )
        self._sides, self._reset_at, self.restart = [], t, (t, x)
        return True

    def _warn(self, number: int, t: float) -> None:
        name = self.program.events[number].name
        self.warnings.append(
            f"event {name!r} may have been missed, first after t = {t:.6g} s: its quantity turns too often for "
            f"{MOST} looks in a step; shorter steps (max_step or dt) find all"
        )


def split_crossings(
    program: EventProgram, happened: Sequence[Happening], nq: int, parameters: Array | None = None
) -> dict[str, Crossings]:
    """Of each event by name, (number, t, x) as times and states, split after nq numbers into q and qd."""
    result = {}
    for number, event in enumerate(program.events):
        matching = [(t, x) for k, t, x in happened if k == number]
        times = np.array([t for t, _ in matching])
        states = np.array([x for _, x in matching]).reshape(len(matching), len(program.components))
        states = converted(program.velocities, times, states, parameters)
        result[event.name] = Crossings(times, states[:, :nq], states[:, nq:])
    return result
