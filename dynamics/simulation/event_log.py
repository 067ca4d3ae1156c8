"""EventLog: the events of a run, block by block, whether one ends it, and the state from which one restarts it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from cgraph.extend import Array

from ..integrators.step_control import RESOLUTION
from .dense_output import StepBlock, with_hermite
from .event_cells import MOST, Flags, WatchedSteps
from .event_location import Crossing, Sides, crossings, start_sides
from .event_program import EventProgram
from .trajectory import Crossings

STEPS = 512  # looked at together
AT_ONCE = 100  # resets at one instant: more than the impacts of a few bodies that touch


class EventLog:
    """The events of a run, (number, t, x) each in `happened`.

    ended: the event that has ended the run, in words.  status: why a reset has stopped it.
    restart: (t, x) to go on from after a reset, else None.
    warnings: a sentence for each event of which some may have been missed.
    """

    def __init__(self, program: EventProgram, parameters: Sequence[float] = ()) -> None:
        self.program, self.parameters = program, list(parameters)
        self.ended = self.status = ""
        self.restart: tuple[float, Array] | None = None
        self.warnings: list[str] = []
        self.happened: list[tuple[int, float, Array]] = []
        self._sides: Sides | None = None  # None before the first step, or the first after a reset
        self._reached: list[tuple[int, float]] = []  # events that have just reset the state, and where from
        self._missed: set[int] = set()
        self._reset_at, self._resets = np.nan, 0  # the instant, to rounding, and how many there in a row
        self._end: tuple[float, Array] | None = None

    def __call__(self, block: StepBlock) -> StepBlock:
        """Note the events of these steps. The steps up to the event after which the run ends or restarts, or all."""
        dense = with_hermite(block, self.program.rate, self.parameters) if block.dense is None else block
        for first in range(0, len(block.t), STEPS):
            part = dense.part(slice(first, first + STEPS))
            steps = WatchedSteps(self.program, self.parameters, part)
            if self._sides is None:
                self._sides = start_sides(steps, self._reached)
            found, beyond = crossings(steps, self._sides)
            self._warn(part, beyond)
            if stop := self._note(steps, found):
                t, x = self.happened[-1][1:]
                return dense.part(slice(first + stop.row + (stop.s > 0.0))).ending(t, x)
            self._end = float(part.t[-1]), part.x[-1]
        return dense

    def finish(self) -> None:
        """The run is at its end: what is zero there to the last bit has arrived."""
        if self._sides is None or self._end is None:
            return
        t, x = self._end
        waiting = [
            (number, bool(self._sides.side[number] < 0.0)) for number in np.flatnonzero(self._sides.waiting).tolist()
        ]
        self._happen(t, x, [(k, rising) for k, rising in waiting if self.program.events[k].counts(rising)])

    def _note(self, steps: WatchedSteps, found: Sequence[Crossing]) -> Crossing | None:
        """Add these events, and return one after which the run does not go on; those of its instant happen with it."""
        if not found:
            return None
        rows, s = (np.array([getattr(one, name) for one in found]) for name in ("row", "s"))
        times, states = steps.times(rows, s).tolist(), steps.block.states_at(rows, s)
        for _, group in itertools.groupby(range(len(found)), lambda k: (found[k].row, found[k].s)):
            together = list(group)
            first = together[0]
            if self._happen(times[first], states[first], [(found[k].number, found[k].rising) for k in together]):
                return found[first]
        return None

    def _happen(self, t: float, x: Array, events: Sequence[tuple[int, bool]]) -> bool:
        """Note events, (number, whether it comes from below), of one instant; whether one ends or resets the run."""
        self.happened += [(number, t, x) for number, _ in events]
        for number, _ in events:
            if self.program.events[number].terminal:
                self.ended = f"event {self.program.events[number].name!r} at t = {t:.6g} s"
                return True
        before = dict(self._reached)
        reached = [(number, -1.0 if rising else 1.0) for number, rising in events if number in self.program.resets]
        if not reached:
            return False
        self._reached = reached
        slopes = self.program.motion(t, x, self.parameters)
        lost = any(number in before and slopes[number] * side > 0.0 for number, side in reached)  # in rounding
        for number, _ in self._reached:
            x = self.program.reset(number, t, x, self.parameters)
        name = self.program.events[self._reached[-1][0]].name
        if len(bad := np.flatnonzero(~np.isfinite(x))):
            component = self.program.components[bad[0]]
            self.status = f"stopped at t = {t:.6g} s: {component} is {x[bad[0]]} after the reset of event {name!r}"
        self._resets = self._resets + 1 if abs(t - self._reset_at) <= RESOLUTION * abs(t) else 0
        if self._resets > AT_ONCE or lost:
            self.status = (
                f"stopped at t = {t:.6g} s: event {name!r} resets the state again and again at this instant; "
                "a contact that stays needs other equations from here on"
            )
        self._sides, self._reset_at, self.restart = None, t, (t, x)
        return True

    def _warn(self, part: StepBlock, beyond: Flags) -> None:
        """A sentence for each event that did not have one yet."""
        for number in np.flatnonzero(beyond.any(axis=1)).tolist():
            if number in self._missed:
                continue
            self._missed.add(number)
            t = part.t_old[np.argmax(beyond[number])]
            name = self.program.events[number].name
            self.warnings.append(
                f"event {name!r} may have been missed, first after t = {t:.6g} s: its quantity turns too often for "
                f"{MOST} looks in a step; shorter steps (max_step or dt) find all"
            )

    def crossings(self, half: int) -> dict[str, Crossings]:
        """Of each event by name, with states split after `half` numbers into q and qd."""
        return split_crossings(self.program, self.happened, half)


def split_crossings(
    program: EventProgram, happened: Sequence[tuple[int, float, Array]], half: int
) -> dict[str, Crossings]:
    """Of each event by name, (number, t, x) as times and states, split after `half` numbers into q and qd."""
    result = {}
    for number, event in enumerate(program.events):
        matching = [(t, x) for k, t, x in happened if k == number]
        states = np.array([x for _, x in matching]).reshape(len(matching), len(program.components))
        result[event.name] = Crossings(np.array([t for t, _ in matching]), states[:, :half], states[:, half:])
    return result
