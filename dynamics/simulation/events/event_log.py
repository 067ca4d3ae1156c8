"""EventLog: the events of a run, where quantities are zero, by bounds on cells of steps, and what events reset."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...integrators.step_control import RESOLUTION
from ..steps.dense_output import UNIT, Indices, StepBlock
from ..steps.row_values import values_of
from ..steps.state_sizes import Flags
from .crossing_search import quantities, told_by_slopes
from .event import EventProgram, WatchedEvent, numbers_of

MOST_CELLS = 1024  # of a step
SHORTEST = 2.0**-48  # of a step, a cell
PARTS, TOGETHER = 32, 8192  # into which a cell is divided again and again, and those of all cells together
WHILE = 2.0**-20  # of a step
SMALL = 2.0**-10  # of what a quantity is in a cell: an end that is less may be zero to rounding
BITS = 56.0  # of where in a cell
STEPS = 512  # looked at together
ROUNDED = 3.0  # times a state, until it is read: at both ends of a step and between
AT_ONCE = 32  # restarts of the run in a row, at one instant or of contacts that rest
RESETS = 10_000  # one after another before a restart: more than bodies that touch need to come apart
MISSED = "may have been missed, first after t = {:.6g} s; shorter steps (max_step or dt) find all"
UNSIDED = "starts at zero and leaves it at t = {:.6g} s, where nothing is reset: it needs a direction, to know its side"

Happening = tuple[int, float, Array]  # number of the event, time, state


class Crossing(NamedTuple):
    """Crossing of zero by a quantity."""

    row: int  # of the step
    s: float  # share of the step
    side: float  # the sign with which it comes; 0 of one that has none, and leaves zero
    touching: bool  # whether it turns back
    resting: bool = False  # whether it was at rest there, and leaves


@dataclass
class Side:
    """Side of zero on which a quantity is, between one part of a run and the next."""

    sign: float = 0.0  # its last, 0 before it has one; at rest on zero that of the side that it belongs to, if any
    slope: float = math.nan  # at the end of the last step
    leaving: bool = False  # whether it starts on zero and moves to this side
    resting: bool = False  # whether it has been zero, to rounding, since the start or the last reset
    waiting: bool = False  # whether it is zero at the last instant: the next step tells what it does there


class WatchedSteps(NamedTuple):
    """Steps with dense output, and the quantity of an event at shares s, (k,) or (k, parts), of rows (k,)."""

    event: WatchedEvent
    parameters: Sequence[float]
    block: StepBlock
    noise: float = 0.0  # what the rounding of the quantity is at least

    def _points(self, rows: Indices, s: Array) -> tuple[Indices, Array, Array, Array]:
        rows, s = np.repeat(rows, s.size // max(1, len(rows))), s.ravel()
        return rows, s, self.block.times_at(rows, s), self.block.states_at(rows, s)

    def values(self, rows: Indices, s: Array) -> Array:
        """The quantity."""
        _, _, t, x = self._points(rows, s)
        return numbers_of(self.event.values, t, x, self.parameters).reshape(s.shape)

    def slopes(self, rows: Indices, s: Array) -> Array:
        """Its derivatives by the share of the step."""
        rows, shares, t, x = self._points(rows, s)
        x_dot, t_dot = self.block.slopes_at(rows, shares), self.block.h[rows]
        return numbers_of(self.event.slopes, t, x, self.parameters, x_dot, t_dot).reshape(s.shape)

    def rounding(self, rows: Indices, s: Array) -> Array:
        """Rounding errors of its values."""
        rows, _, t, x = self._points(rows, s)
        error = numbers_of(self.event.errors, t, x, self.parameters, *self.block.rounding(rows, t, x))
        return np.maximum(self.noise, error).reshape(s.shape)


class Cells(NamedTuple):
    """Parts of steps, from share a to share b, with values and slopes of a quantity at both, (k,) each."""

    rows: Indices
    a: Array
    b: Array
    g_a: Array
    g_b: Array
    slope_a: Array
    slope_b: Array
    clear: Flags  # whether the quantity cannot be zero there
    broken: Flags  # whether it has a pole there: no bounds, or a turn of sign against both slopes

    def take(self, which: Flags | Indices) -> Cells:
        """Subset of the cells."""
        return Cells._make([array[which] for array in self])

    def replaced(self, split: Flags, *halves: Cells) -> tuple[Cells, Indices]:
        """The cells with left and right parts in place of those of `split`, and which of rest and parts they are."""
        cells = Cells._make([np.concatenate(parts) for parts in zip(self.take(~split), *halves, strict=True)])
        order = np.lexsort((cells.a, cells.rows))
        return cells.take(order), order


def event_cells(steps: WatchedSteps) -> tuple[Cells, Flags]:
    """Cells of all steps in order, in which a quantity is not zero or goes one way, but for rounding; and for which
    steps, (steps,), `MOST_CELLS` were too few.
    """
    count, p = len(steps.block.t), np.array(steps.parameters)
    watched = quantities(steps.event.values, steps.block.x.shape[1])
    rows, none = np.arange(count), np.zeros(count, bool)
    g_a, g_b, slope_a, slope_b = [of(rows, none + s) for of in (steps.values, steps.slopes) for s in (0.0, 1.0)]
    cells = Cells(rows, none + 0.0, none + 1.0, g_a, g_b, slope_a, slope_b, none, none.copy())
    done, beyond, new = none.copy(), none.copy(), ~none
    while True:
        fresh = cells.take(new)
        noise = 2.0 * steps.rounding(fresh.rows, fresh.b)
        clear, goes_one_way, bounded = told_by_slopes(watched, p, steps.block, fresh[:3], fresh.g_a, fresh.g_b, noise)
        size = np.maximum(np.abs(fresh.g_a), np.abs(fresh.g_b))
        told = clear | goes_one_way | (bounded & (size <= noise))
        nothing = np.isnan(fresh.g_a) & np.isnan(fresh.g_b)
        done[new] = told | nothing | (fresh.b - fresh.a <= SHORTEST)
        rise = fresh.g_b - fresh.g_a
        against = (rise * fresh.slope_a < 0.0) & (rise * fresh.slope_b < 0.0) & (fresh.g_a * fresh.g_b < 0.0)
        cells.clear[new], cells.broken[new] = clear, ~(bounded & np.isfinite(rise)) | against
        size = np.bincount(cells.rows, minlength=count) + np.bincount(cells.rows[~done], minlength=count)
        late = (size > MOST_CELLS)[cells.rows] & ~done
        beyond[cells.rows[late]] = True
        split = ~done & ~late
        if not split.any():
            return cells, beyond
        few = cells.take(split)
        middle = few.a + 0.5 * (few.b - few.a)
        g, slope = steps.values(few.rows, middle), steps.slopes(few.rows, middle)
        halves = few._replace(b=middle, g_b=g, slope_b=slope), few._replace(a=middle, g_a=g, slope_a=slope)
        left = int((~split).sum())
        cells, order = cells.replaced(split, *halves)
        new, done = order >= left, np.append((done | late)[~split], np.zeros(2 * len(middle), dtype=bool))[order]


def crossings(steps: WatchedSteps, side: Side) -> tuple[list[Crossing], Flags]:
    """Crossings in these steps, and flags of (steps,) in which more may have happened; moves `side` on."""
    # Touching is an extremum that is zero to rounding. What stays zero arrives once; what rests and leaves to the other
    # side than its own crosses zero where it leaves.
    cells, beyond = event_cells(steps)
    # where steps meet, the slope is that at the end of the step before: a turn counts once
    first = np.flatnonzero(np.diff(cells.rows)) + 1
    cells.slope_a[first] = cells.slope_b[first - 1]
    if not math.isnan(side.slope):
        cells.slope_a[0] = side.slope
    side.slope = float(cells.slope_b[-1])
    cells, extrema = _at_extrema(steps, cells)
    rows, s = np.concatenate([cells.rows[:1], cells.rows]), np.concatenate([cells.a[:1], cells.b])  # of looks
    g = np.concatenate([cells.g_a[:1], cells.g_b])
    # the sign before the first look, and those at looks; 0 of a quantity at zero
    signs = np.nan_to_num(np.sign(np.append(side.sign, g)))
    zero = g == 0.0
    zero[0] |= side.leaving or side.resting
    broken = np.append(False, cells.broken)  # before each look
    beside = np.concatenate([np.flatnonzero((signs[:-1] * signs[1:] < 0.0) & ~broken), extrema])
    _add_rounded_zeros(zero, beside, lambda looks: np.abs(g[looks]) <= steps.rounding(rows[looks], s[looks]))
    signs[1:][zero] = 0.0
    if side.leaving:
        signs[1], side.leaving = side.sign, False
    found, arrivals = list[Crossing](), list[int]()

    def stays(begin: int, end: int) -> bool:
        """Whether the quantity is exactly zero for a while, not only at looks that lie side by side at a touch."""
        zeros = begin + np.flatnonzero(g[begin:end] == 0.0)
        place = rows[zeros] + s[zeros]
        return len(zeros) > 1 and bool(place[-1] - place[0] > WHILE)

    known = np.flatnonzero(signs)
    known = known[known > 0] if side.resting else known
    if not len(known):
        return [], beyond
    if side.resting:
        side.resting, look = False, max(int(known[0]) - 2, 0)
        if side.sign != signs[known[0]]:
            found.append(Crossing(int(rows[look]), float(s[look]), side.sign, touching=False, resting=True))
    here, there, last = known[:-1], known[1:], int(known[-1])
    turns = np.flatnonzero((signs[here] != signs[there]) | (there > here + 1))
    for i, j in zip(here[turns].tolist(), there[turns].tolist(), strict=True):
        if signs[i] != signs[j] or stays(i, j - 1):
            arrivals.append(i)
        else:
            between = [look for look in extrema.tolist() if i <= look < j - 1]
            look = between[0] if between else (i + j - 2) // 2
            found.append(Crossing(int(rows[look]), float(s[look]), float(signs[i]), touching=True))
    side.sign = float(signs[last])
    if stays(last, len(g)):
        arrivals.append(last)
        side.sign = 0.0
    side.waiting = bool(zero[-1]) and side.sign != 0.0
    # an arrival is at the next look, if that is zero or the first, or within the cell before it
    looks = np.array([i for i in arrivals if i == len(g) or not broken[i]], dtype=np.intp)
    inside = (looks > 0) & ~zero[np.minimum(looks, len(g) - 1)]
    places, few, sign = s[looks], cells.take(looks[inside] - 1), signs[looks]
    places[inside] = _turn(lambda s: steps.values(few.rows, s) * sign[inside, None] > 0.0, few.a, few.b)[1]
    at = zip(rows[looks].tolist(), places.tolist(), sign.tolist(), strict=True)
    return [*found, *[Crossing(row, share, side, touching=False) for row, share, side in at]], beyond


def _at_extrema(steps: WatchedSteps, cells: Cells) -> tuple[Cells, Indices]:
    """The cells, parted at extrema where a quantity may come to zero and turn back; and the looks there."""
    turns = (cells.slope_a != 0.0) & (cells.slope_a * cells.slope_b <= 0.0)
    few = cells.take(turns)
    ends = np.stack([few.g_a, few.g_b])
    toward = (ends * np.sign(few.slope_a) < 0.0).all(axis=0)
    third = (few.b - few.a) / 3.0
    points = np.abs(np.stack([*ends, few.g_a + few.slope_a * third, few.g_b - few.slope_b * third]))
    at_zero = np.abs(ends).min(axis=0) <= SMALL * points.max(axis=0)
    turns[turns] = (toward | at_zero) & ~few.clear
    few = cells.take(turns)
    if not len(few.a):
        return cells, np.zeros(0, dtype=np.intp)
    sign = -np.sign(few.slope_a)
    pair = _turn(lambda s: steps.slopes(few.rows, s) * sign[:, None] < 0.0, few.a, few.b)
    at, g = np.stack(pair), np.stack([steps.values(few.rows, s) for s in pair])
    nearest = np.argmin(g * sign, axis=0)[None]
    s, value = (np.take_along_axis(table, nearest, axis=0)[0] for table in (at, g))
    parted, _ = cells.replaced(turns, few._replace(b=s, g_b=value), few._replace(a=s, g_a=value))
    return parted, np.flatnonzero(turns) + np.arange(1, len(s) + 1)


def _add_rounded_zeros(zero: Flags, beside: Indices, rounded: Callable[[Indices], Flags]) -> None:
    """Flag looks that are zero to rounding near another at zero or `beside`: at an extremum, or after a sign turns."""
    tested, near = np.zeros(len(zero), dtype=bool), np.flatnonzero(zero)
    while True:
        looks = np.unique(np.concatenate([near - 1, near, near + 1, beside - 1, beside]))
        looks = looks[(looks >= 0) & (looks < len(zero))]
        looks, beside = looks[~tested[looks]], beside[:0]
        if not len(looks):
            return
        tested[looks] = True
        near = looks[rounded(looks)]
        zero[near] = True


def _turn(same: Callable[[Array], Flags], low: Array, high: Array) -> tuple[Array, Array]:
    """Shares (k,), one apart in the last bit, between which `same`, true at `low` and false at `high`, first turns."""
    if not len(low):
        return low, high
    parts = max(2, min(PARTS, TOGETHER // len(low)))
    for _ in range(math.ceil(BITS / math.log2(parts))):
        s = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, parts + 1)
        s[:, -1] = high
        turned = ~same(s[:, 1:-1])
        first = np.where(turned.any(axis=1), np.argmax(turned, axis=1) + 1, parts)[:, None]
        low, high = (np.take_along_axis(s, at, axis=1)[:, 0] for at in (first - 1, first))
    return low, high


class _Look(NamedTuple):
    """The quantities at an instant: whether they are zero, their values, and the motions of those at zero, (k,)."""

    zero: Flags
    values: Array
    motions: Array


class EventLog:
    """The events of a run."""

    def __init__(self, program: EventProgram) -> None:
        self.program, self.resetting = program, any([event.reset is not None for event in program.events])
        self.parameters: Sequence[float] = ()  # of the rate, in the block that is to come
        self.ended = self.status = ""  # the event that has ended the run, and why a reset has stopped it
        self.restart: tuple[float, Array, Array] | None = None  # time, the state that was reset, the one to go on from
        self.said: dict[tuple[int, str], str] = {}  # sentences, by the number of an event and what they say
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
            rows, s = np.array([one.row for one, _ in found], dtype=np.intp), np.array([one.s for one, _ in found])
            instants = zip(found, part.times_at(rows, s).tolist(), part.states_at(rows, s), strict=True)
            for (row, share), group in itertools.groupby(instants, lambda each: each[0][0][:2]):
                (first_one, t, x), *others = group
                arrived = {number: one for one, number in [first_one, *[each for each, _, _ in others]]}
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
        waiting = {k: Crossing(0, 1.0, side.sign, touching=False) for k, side in enumerate(self._sides) if side.waiting}
        if self._last is not None:
            self._happen(self._last, float(self._last.t[0]), self._last.x[0], waiting)

    def _found(self, part: StepBlock) -> list[tuple[Crossing, int]]:
        """Crossings in these steps, and the numbers of the events, in order."""
        found, events = list[tuple[Crossing, int]](), self.program.events
        self._see(part, 0, part.x_old[0])
        if not self._sides:  # zero, to rounding, is rest; with a reset, on the side to come from
            own = [0.0 if event.reset is None else side for event, side in zip(events, self._from, strict=True)]
            self._sides = _sides(self._look(part.t_old[0], part.x_old[0])._replace(motions=np.zeros(len(own))), own)
        for number, side in enumerate(self._sides):
            noise = self._noise(number, float(part.t[-1]), part.x[-1]) if side.resting else 0.0
            some, beyond = crossings(WatchedSteps(events[number], self.parameters, part, noise), side)
            found += [(one, number) for one in some]
            if beyond.any():
                self._say(number, MISSED, part.t_old[np.argmax(beyond)])
        return sorted(found, key=lambda each: (*each[0][:2], each[1], each[0]))

    def _see(self, part: StepBlock, steps: int, x: Array) -> None:
        """The run came to x by the first steps of a part: how far its states have gone, and how many roundings old."""
        self._steps += steps
        seen = [np.vstack([part.x_old[:steps], x])]
        if self.resetting:  # rates tell what a reset leaves at rest
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
        """Reset the state at an instant of a step.  rested: what was at zero at the start of the step."""
        # What is due and has no reset happens, then the first reset that is due, and it is looked again. Due is what is
        # zero and moves to the other side than it has come from; what touches, once.
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
        why = "the state again and again at this instant; a contact that stays needs other equations from here on"
        return f"{stopped} {which} {why}"

    def _look(self, t: float, x: Array, step: StepBlock | None = None) -> _Look:
        """The quantities at an instant of a step, also after resets there; or at a start."""
        at, states, p, events = np.array([t]), x[None], self.parameters, self.program.events
        values = np.array([numbers_of(event.values, at, states, p)[0] for event in events])
        end = 0.0 if step is None else step.x
        zero = np.abs(values) <= np.array([self._noise(number, t, x, end) for number in range(len(events))])
        x_dot = self.program.rates(at, states, p)
        fastest = np.fmax(self._gone[1:], np.where(np.isfinite(x_dot), np.abs(x_dot), 0.0))
        motions, none = np.zeros(len(events)), np.zeros_like(states)
        for number in np.flatnonzero(zero):
            motion = numbers_of(events[number].slopes, at, states, p, x_dot, np.ones(1))[0]
            pairs = ((fastest, np.ones(1)), (none, np.zeros(1)))
            off, own = [numbers_of(events[number].errors, at, states, p, *pair)[0] for pair in pairs]
            motions[number] = 0.0 if abs(motion) <= self._roundings * (off - own) else motion
        return _Look(zero, values, motions if step is None else motions * np.sign(step.h[0]))

    @property
    def _roundings(self) -> float:
        """Rounding errors of states by now, relative to how far they have gone: those of steps add up at random."""
        return UNIT * ROUNDED * math.sqrt(1.0 + self._steps)

    def _noise(self, number: int, t: float, x: Array, end: Array | float = 0.0) -> float:
        """Error of a quantity by the rounding of states, also inside a step to an end (1, m)."""
        graph, at, share = self.program.events[number].errors, np.array([t]), self._roundings
        errors = share * self._gone[:1] + UNIT * np.abs(end), share * np.abs(at)
        return float(numbers_of(graph, at, x[None], self.parameters, *errors)[0])

    def _say(self, number: int, what: str, t: float) -> None:
        self.said.setdefault((number, what), f"event {self.program.events[number].name!r} {what.format(t)}")


def _sides(look: _Look, own: Sequence[float] | Array) -> list[Side]:
    """Sides of quantities: of one at zero that to which it moves, or rest on its own side."""
    signs = zip(look.zero, np.sign(look.values).tolist(), np.sign(look.motions).tolist(), own, strict=True)
    return [
        Side(value) if not zero else Side(motion, leaving=True) if motion else Side(float(side), resting=True)
        for zero, value, motion, side in signs
    ]
