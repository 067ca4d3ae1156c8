"""EventLog: the events of a run, block by block, and what they reset."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...integrators.step_control import RESOLUTION
from ..steps.dense_output import UNIT, StepBlock
from ..steps.row_values import values_of
from ..steps.state_sizes import Flags
from .crossings import MOST_CELLS, Crossing, Side, WatchedSteps, crossings
from .event import EventProgram

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


class _Look(NamedTuple):
    """The quantities at an instant: whether they are zero, their values, and the motions of those at zero, (k,)."""

    zero: Flags
    values: Array
    motions: Array


class EventLog:
    """The events of a run, (number, t, x) each in `happened`.

    ended: the event that has ended the run, in words.  status: why a reset has stopped it.
    parameters: of the rate, those of the block that is to come.
    restart: (t, x, x_new), the state that was reset and the one to go on from, else None.
    said: {(number of an event, what): sentence}, once each.  resetting: whether there are events that reset the state.
    """

    def __init__(self, program: EventProgram) -> None:
        self.program, self.resetting = program, any([event.reset is not None for event in program.events])
        self.parameters: Sequence[float] = ()
        self.ended = self.status = ""
        self.restart: tuple[float, Array, Array] | None = None
        self.said: dict[tuple[int, str], str] = {}
        self.happened: list[Happening] = []
        self._sides: list[Side] = []  # none before the first step
        self._from = np.array([-float(event.direction) for event in program.events])  # sides, see `Crossing`
        self._steps = 0
        self._gone = np.zeros((2, len(program.components)))  # how far states and their rates, at least their sizes
        self._done: set[int] = set()  # events that happen again only after they have not been due
        self._reset_at, self._restarts = math.nan, 0  # the instant, and how many in a row from which nothing got away
        self._last: StepBlock | None = None

    def __call__(self, block: StepBlock) -> StepBlock:
        """Note the events of these steps. The steps up to the event after which the run ends or restarts, or all."""
        for first in range(0, len(block.t), STEPS):
            part = block.part(slice(first, first + STEPS))
            found = self._found(part)
            rows, s = np.array([one[0] for one in found], dtype=np.intp), np.array([one[1] for one in found])
            instants = zip(found, part.times_at(rows, s).tolist(), part.states_at(rows, s), strict=True)
            for (row, share), group in itertools.groupby(instants, lambda one: one[0][:2]):
                together = list(group)
                _, t, x = together[0]
                arrived = {number: one for (_, _, number, one), _, _ in together}
                if self._happen(part.part(slice(row + 1)), t, x, arrived):
                    return block.part(slice(first + row + (share > 0.0))).ending(t, x)
            self._see(part, len(part.t), part.x[-1])
            self._last = part.part(slice(-1, None))
        return block

    @property
    def resets(self) -> int:
        """How many resets there were."""
        return sum(self.program.events[number].reset is not None for number, _, _ in self.happened)

    def finish(self) -> None:
        """The run is at its end: what is zero there to the last bit has arrived."""
        if self._last is not None:
            sides = enumerate(self._sides)
            waiting = {number: Crossing(0, 1.0, side.sign, touching=False) for number, side in sides if side.waiting}
            self._happen(self._last, float(self._last.t[0]), self._last.x[0], waiting)

    def _found(self, part: StepBlock) -> list[tuple[int, float, int, Crossing]]:
        """Step, share of it, number of the event, and what its quantity does, of crossings in these steps, in order."""
        found, events = list[tuple[int, float, int, Crossing]](), self.program.events
        self._see(part, 0, part.x_old[0])
        if not self._sides:  # zero, to rounding, is rest; with a reset, on the side to come from
            own = [0.0 if event.reset is None else side for event, side in zip(events, self._from, strict=True)]
            self._sides = _sides(self._look(part.t_old[0], part.x_old[0])._replace(motions=np.zeros(len(own))), own)
        for number, side in enumerate(self._sides):
            noise = self._noise(number, float(part.t[-1]), part.x[-1]) if side.resting else 0.0
            some, beyond = crossings(WatchedSteps(events[number], self.parameters, part, noise), side)
            found += [(one.row, one.s, number, one) for one in some]
            if beyond.any():
                self._say(number, MISSED, part.t_old[np.argmax(beyond)])
        return sorted(found)

    def _see(self, part: StepBlock, steps: int, x: Array) -> None:
        """The run came to x by the first steps of a part: how far its states have gone, and how many roundings old.

        Rates tell what a reset leaves at rest.
        """
        self._steps += steps
        seen = [np.vstack([part.x_old[:steps], x])]
        if self.resetting:
            times = np.append(part.t_old[:steps], part.t_old[0] if steps == 0 else part.t[steps - 1])
            seen.append(self.program.rates(times, seen[0], self.parameters))
        for k, values in enumerate(seen):
            values = np.where(np.isfinite(values), values, 0.0)
            self._gone[k] += np.abs(np.diff(values, axis=0)).sum(axis=0)
            np.fmax(self._gone[k], np.abs(values).max(axis=0), out=self._gone[k])

    def _happen(self, part: StepBlock, t: float, x: Array, arrived: Mapping[int, Crossing]) -> bool:
        """Note what reaches zero at an instant of the last of these steps; whether that ends or resets the run."""
        events = self.program.events
        due = {n for n, one in arrived.items() if one.side and events[n].counts(one.side, touching=one.touching)}
        resets = any([events[n].reset for n in due]) and not any([events[n].terminal for n in due])
        step = part.part(slice(-1, None))
        if resets:
            self._see(part, len(part.t), x)
            before = self._look(step.t_old[0], step.x_old[0], step)
            # another reset may move what only the next step would find at zero
            self._from = np.where(before.zero, self._from, np.sign(before.values))
        for number, one in arrived.items():
            if one.side:
                self._from[number] = one.side
            elif events[number].reset is not None:
                self._say(number, UNSIDED, t)
        if resets:
            self._reset(step, t, x, {n: arrived[n] for n in due}, before.zero)
        else:
            self._note(due, t, x)
        return resets or bool(self.ended)

    def _reset(self, step: StepBlock, t: float, x: Array, new: Mapping[int, Crossing], rested: Flags) -> None:
        """Reset the state at an instant of a step.

        One rule: what is due and has no reset happens, then the first reset that is due, and it is looked again. Due is
        what is zero and moves to the other side than it has come from; what touches, once. One that ends the run does
        so before any reset.  rested: what was at zero at the start of the step.
        """
        events, start, resets, look = self.program.events, x, list[int](), self._look(t, x, step)
        touching = {number for number, one in new.items() if one.touching}
        returns = np.flatnonzero(rested & look.zero & (look.motions * self._from > 0.0)).tolist()
        due = touching | {*new}.difference(returns)  # what was at zero, and returns to its side, has not really left
        while len(resets) <= RESETS and np.isfinite(x).all():
            side = np.where(self._from == 0.0, -np.sign(look.motions), self._from)
            away = np.flatnonzero(look.zero & (look.motions * side < 0.0)).tolist()
            leaving = {n for n in away if events[n].counts(self._from[n])}
            self._done &= leaving
            if resets:
                due = (due & touching) | (leaving - self._done)
            first = {n for n in due if events[n].reset is None} or {*sorted(due)[:1]}
            due -= first
            for n in first:
                self._from[n] = self._from[n] or -np.sign(look.motions[n])
            self._note(first, t, x)
            if self.ended or not first:
                break
            if (graph := events[min(first)].reset) is not None:
                resets += first
                x = values_of(graph, [*x, t, *self.parameters], 1)[:, 0]
                look = self._look(t, x, step)
        again = all([one.resting for one in new.values()]) or abs(t - self._reset_at) <= RESOLUTION * abs(t)
        self._restarts = self._restarts + 1 if again else 0
        self._reset_at, self.restart = t, (t, start, x)
        self.status = self._failure(t, x, resets, new)
        self._from = np.where(look.zero & (look.motions != 0.0), np.sign(look.motions), self._from)
        self._sides = _sides(look, self._from)

    def _note(self, numbers: Collection[int], t: float, x: Array) -> None:
        """These events happen at an instant and a state, which may end the run."""
        self._done |= {*numbers}
        for number in sorted(numbers):
            self.happened.append((number, t, x))
            if self.program.events[number].terminal and not self.ended:
                self.ended = f"event {self.program.events[number].name!r} at t = {t:.6g} s"

    def _failure(self, t: float, x: Array, resets: Sequence[int], new: Collection[int]) -> str:
        """Reason why resets by new events, the last of which made x, stop the run; empty if they do not."""
        events, stopped = self.program.events, f"stopped at t = {t:.6g} s:"
        if len(bad := np.flatnonzero(~np.isfinite(x))):
            after = f" after the reset of event {events[resets[-1]].name!r}" if resets else ""
            return f"{stopped} {self.program.components[bad[0]]} is {x[bad[0]]}{after}"
        if len(resets) <= RESETS and self._restarts <= AT_ONCE:
            return ""
        names = [f"{events[number].name!r}" for number in sorted({*(resets[-AT_ONCE:] or new)})]
        which = f"event {names[0]} resets" if len(names) == 1 else f"events {', '.join(names)} reset"
        what = f"{which} the state again and again at this instant"
        return f"{stopped} {what}; a contact that stays needs other equations from here on"

    def _look(self, t: float, x: Array, step: StepBlock | None = None) -> _Look:
        """The quantities at an instant of a step, also after resets there; or at a start."""
        at, states, p, events = np.array([t]), x[None], self.parameters, self.program.events
        values = np.array([event.value(at, states, p)[0] for event in events])
        end = 0.0 if step is None else step.x
        zero = np.abs(values) <= np.array([self._noise(number, t, x, end) for number in range(len(events))])
        x_dot = self.program.rates(at, states, p)
        fastest = np.fmax(self._gone[1:], np.where(np.isfinite(x_dot), np.abs(x_dot), 0.0))
        motions, none = np.zeros(len(events)), np.zeros_like(states)
        for number in np.flatnonzero(zero):
            event = events[number]
            motion = event.slope(at, states, p, x_dot, np.ones(1))[0]
            off = event.error(at, states, p, fastest, np.ones(1)) - event.error(at, states, p, none, np.zeros(1))
            motions[number] = 0.0 if abs(motion) <= self._roundings * off[0] else motion
        return _Look(zero, values, motions if step is None else motions * np.sign(step.h[0]))

    @property
    def _roundings(self) -> float:
        """Rounding errors of states by now, relative to how far they have gone.

        Roundings of steps add up at random; a rate that is off takes its state off by that share of the whole way.
        """
        return UNIT * ROUNDED * math.sqrt(1.0 + self._steps)

    def _noise(self, number: int, t: float, x: Array, end: Array | float = 0.0) -> float:
        """Error of a quantity by the rounding of states, also inside a step to an end (1, m)."""
        errors = self._roundings * self._gone[:1] + UNIT * np.abs(end), np.array([self._roundings * abs(t)])
        return float(self.program.events[number].error(np.array([t]), x[None], self.parameters, *errors)[0])

    def _say(self, number: int, what: str, t: float) -> None:
        self.said.setdefault((number, what), f"event {self.program.events[number].name!r} {what.format(t)}")


def _sides(look: _Look, own: Sequence[float] | Array) -> list[Side]:
    """Sides of quantities: of one at zero that to which it moves, or rest on its own side."""
    signs = zip(look.zero, np.sign(look.values).tolist(), np.sign(look.motions).tolist(), own, strict=True)
    return [
        Side(value) if not zero else Side(motion, leaving=True) if motion else Side(float(side), resting=True)
        for zero, value, motion, side in signs
    ]
