"""Modes: the sides of the switching surfaces of a motion, as it goes on: which are crossed, and what holds after."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, kept_by_first
from cgraph.extend import Builder

from ...integrators import Problem
from ...integrators.rate_in_modes import sliding
from ...integrators.switches import Switches
from ...systems.kinematics import changes, numbered_graph
from ..steps.dense_output import UNIT, Indices, StepBlock
from ..steps.row_values import values_of
from ..steps.state_sizes import Flags
from .crossing_search import Crossing, Quantities, first_crossing, outputs_of, quantities, steps_near_zero
from .event import rounding_errors

AT_ONCE = 1e-11  # of the sizes of the states so far: by so much surfaces may be off that are met at one instant
SHARE = 1e-9  # of a slide, which is rounding
LATER, AHEAD = 3, 1e-6  # of the time in which states go as far as they have been, after which they are looked at later
FEW = 5  # surfaces at an instant, of which all combinations are tried
ROUNDS = 50  # of pivots for each of more
STUCK = 20  # turns at one instant, besides three of each surface
ALIKE = 1e-7  # relative: slopes and rates that are the same but for the error of steps


class Turn(NamedTuple):
    """Instant from which modes hold."""

    t: float
    modes: tuple[float, ...]
    slides: frozenset[int] | None  # surfaces of which some are slid on, if any is
    number: int  # of the margin that was zero there; -1 at a start

    def of(self, problem: Problem) -> Problem:
        """The problem that holds from here on."""
        return problem if self.slides is None else sliding(problem, self.slides)


@kept_by_first
def _drift(problem: Problem, order: int) -> Graph:
    """The derivatives of that order of all gaps by the time along the motion."""
    graph = problem.switches.gaps if order == 1 else _drift(problem, order - 1)  # type: ignore[union-attr]
    states, rates = problem.rate.inputs[: problem.size], problem.rate.outputs.values()
    seeds = dict(zip(states, rates, strict=True)) | {problem.rate.inputs[problem.size]: cg.constant(1.0)}
    nodes = list(graph.outputs.values())
    return cg.simplify(numbered_graph(graph.inputs, changes(seeds, nodes, Builder())))


@kept_by_first
def _gap_errors(problem: Problem) -> Graph:
    gaps = problem.switches.gaps  # type: ignore[union-attr]
    return rounding_errors(gaps, gaps.inputs[: problem.size + 1])


class Modes:
    """The sides of surfaces of one motion after another."""

    def __init__(self, problem: Problem) -> None:
        assert problem.switches is not None
        self.plain, self._switches = problem, problem.switches
        self.words = problem.switches.words  # of the surfaces, as formulas
        self.values, self.direction = np.ones(len(self._switches.modes)), 1.0  # -1 where time runs back
        self.turns = list[Turn]()
        self.failed = ""
        self._spacing = np.array(self._switches.spacing)
        self._among = frozenset(np.flatnonzero(self._switches.signs).tolist())
        self.sizes = np.zeros(problem.size)
        self._fresh = self._left = np.full(len(self.values), np.nan)
        self._at = (np.nan, 0)  # the instant of the last turn, and how many there were at it

    @property
    def slid(self) -> Flags:
        """Whether the motion slides on each surface."""
        return self._slid(self.values)

    def _slid(self, modes: Sequence[float] | Array) -> Flags:
        return np.asarray((np.array(modes) - 1.0) / self._spacing % 1.0 != 0.0)

    @property
    def problem(self) -> Problem:
        """The problem by which the motion goes on."""
        return self.problem_in(self.values.tolist())

    def see(self, x: Array) -> None:
        """States (.., m) that the motion has come to."""
        self.sizes = np.fmax(self.sizes, np.abs(x).reshape(-1, len(self.sizes)).max(axis=0))

    def begin(self, t: float, x: Array, p: Sequence[float]) -> None:
        """The sides at a start."""
        self.failed, self.sizes, self._at = "", np.abs(x), (np.nan, 0)
        self.values = np.where(self._spacing == 2.0, 1.0, 0.0)
        for _ in range(len(self.values) + 1):
            before, gaps = self.values, self._gaps(t, x, p)
            sides = np.where(gaps < 0.0, -1.0, 1.0)
            self.values = np.where(self._spacing == 2.0, sides, self.values + np.floor(gaps))
            if np.array_equal(before, self.values):
                break
        self._decide(t, x, p, np.zeros(len(self.values), dtype=bool))

    def first_crossing(self, block: StepBlock, p: Sequence[float]) -> tuple[Crossing | None, bool]:
        """Where a surface is crossed in these steps, or a slide ends."""
        watched, turns = self._watched
        fresh = np.where(self.slid & ~np.isnan(self._fresh), SHARE, self._fresh)[[k for k, _ in turns]]
        found = first_crossing(watched, np.array([*p, *self.values]), block, fresh)
        self._left, self._fresh = self._fresh, np.full(len(self.values), np.nan)
        return found

    def look_again(self, row: int) -> None:
        """The step of a crossing, of the block that was looked at last, is not made: another begins there."""
        self._fresh = self._fresh if row else self._left

    def doubtful(self, block: StepBlock, p: Sequence[float]) -> list[int]:
        """Steps in which a surface may be crossed."""
        found = steps_near_zero(self._watched[0], np.array([*p, *self.values]), block)
        if found[:1] != [0]:
            self._fresh[:] = np.nan
        return found

    def turn(self, t: float, x: Array, p: Sequence[float], number: int) -> None:
        """Turn the mode of a margin that is zero at this state, and what else is due there."""
        k, way = self._watched[1][number]
        crossed = np.zeros(len(self.values), dtype=bool)
        crossed[k] = True
        slid, spacing = self.slid[k], self._spacing[k]
        change = way * 0.5 * spacing if slid else -2.0 * self.values[k] if spacing == 2.0 else way
        self.values = self.values.copy()
        self.values[k] += change
        again = self._at[1] + 1 if abs(t - self._at[0]) <= 8.0 * np.spacing(abs(t)) else 0
        self._at = (t, again)
        if again > STUCK + 3 * len(self.values):
            self.failed = f"stopped at t = {t:.6g} s: surfaces turn again and again there"
            return
        self._decide(t, x, p, crossed, number)

    def touched(self, t: float, x: Array, p: Sequence[float]) -> tuple[int, Array] | None:
        """The margin that is zero to rounding at a state, if one is: what a step does not pass; and the state on it."""
        errors = np.append(AT_ONCE * self.sizes, UNIT * abs(t))[:, None]
        point, (watched, turns) = self._point(t, x, p), self._watched
        allowed = outputs_of(_gap_errors(self.plain), np.concatenate([point, errors]))[[k for k, _ in turns], 0]
        near = np.abs(outputs_of(watched.values, point)[:, 0]) <= allowed
        if not near.any() or self.slid.any():
            return None
        number = int(np.argmax(near))
        normal = _slopes(watched.part(number, number + 1).values, point[:, 0], len(x))[:-1]
        return number, x - outputs_of(watched.values, point)[number, 0] * normal / (normal @ normal)

    def nears(self, t: float, x: Array, p: Sequence[float], h: float) -> bool:
        """Whether the motion comes to a surface in two steps of h, by its rate."""
        point, (watched, _) = self._point(t, x, p), self._watched
        ways = np.append(outputs_of(self.problem.rate, point)[: len(x), 0], 1.0)[:, None]
        ahead = outputs_of(watched.values, point) + 2.0 * h * outputs_of(watched.slopes, point, ways)
        return bool((ahead <= 0.0).any())

    @property
    def _watched(self) -> tuple[Quantities, tuple[tuple[int, int], ...]]:
        switches = self.problem.switches
        assert isinstance(switches, Switches)
        return quantities(switches.margins, self.plain.size, switches.ends), switches.turns

    def _gaps(self, t: float, x: Array, p: Sequence[float]) -> Array:
        return outputs_of(self._switches.gaps, self._point(t, x, p))[:, 0]

    def _point(self, t: float, x: Array, p: Sequence[float]) -> Array:
        """The inputs of a graph, (.., 1)."""
        return np.concatenate([x, [t], p, self.values])[:, None]

    def _decide(self, t: float, x: Array, p: Sequence[float], crossed: Array, number: int = -1) -> None:
        """What holds from here on, of the surfaces at zero; crossed: those of which the mode has turned."""
        slid, floors = self.slid, self._spacing == 1.0
        errors = np.append(AT_ONCE * self.sizes, UNIT * abs(t))
        for _ in range(len(self.values) + 1):  # a mode that has turned may move the surfaces of later ones
            gaps = self._gaps(t, x, p)
            point = np.append(self._point(t, x, p)[:, 0], errors)
            allowed = outputs_of(_gap_errors(self.plain), point[:, None])[:, 0]
            moved = ~(slid | floors | crossed) & (self.values * gaps < -allowed)
            self.values = np.where(moved, -self.values, self.values)
            if not np.any(moved):
                break
        upper_end = floors & ~slid & (np.abs(gaps - 1.0) <= allowed)
        zero = (np.abs(gaps - np.where(floors & slid, 0.5, 0.0)) <= allowed) | upper_end | crossed | slid
        self._fresh = np.where(zero, allowed, np.nan)
        if zero.any():
            among, half = np.flatnonzero(zero), 0.5 * self._spacing
            middle = np.where(slid, self.values, self.values - half * np.where(floors, 1.0, self.values))
            # a floor that has turned down is at the upper end of its side
            middle = np.where(upper_end | (floors & crossed & (gaps > 0.5)), self.values + half, middle)
            found = _Choice(self, t, x, p, among, middle[among], half[among], crossed[among]).found()
            if found is None:
                names = ", ".join([repr(word) for word in dict.fromkeys([self.words[k] for k in among])])
                self.failed = f"stopped at t = {t:.6g} s: no sides of the surfaces there let the motion go on: {names}"
                return
            self.values = self.values.copy()
            self.values[among] = found
            slid = self.slid
            self._among = self._among | frozenset(np.flatnonzero(slid).tolist())
        self.turns.append(Turn(t, tuple(self.values.tolist()), self._among if slid.any() else None, number))

    def problem_in(self, modes: Sequence[float]) -> Problem:
        """The problem that holds in some modes."""
        return sliding(self.plain, self._among) if self._slid(modes).any() else self.plain

    def rate(self, modes: Sequence[float]) -> Graph:
        """The rate in some modes, over all inputs."""
        rate, known = self.problem_in(modes).rate, dict(zip(self._switches.modes, modes, strict=True))
        return Graph(rate.inputs, cg.specialize(rate, known).outputs)

    def margin(self, turn: Turn, number: int) -> Graph:
        """One of the margins of the problem that holds from a turn on."""
        switches = turn.of(self.plain).switches
        assert switches is not None
        return Graph(switches.margins.inputs, {"margin": list(switches.margins.outputs.values())[number]})

    def crossed(self, before: Turn, after: Turn) -> list[tuple[int, int]]:
        """The modes that change between two turns, and the margins that are zero there, that which was found first."""
        switches = before.of(self.plain).switches
        assert switches is not None
        found, first_end = [(switches.turns[after.number][0], after.number)], len(switches.turns) - switches.ends
        slid = self._slid(before.modes)
        for k, (one, two) in enumerate(zip(before.modes, after.modes, strict=True)):
            if one != two and k != found[0][0]:
                of_end = range(len(switches.turns))[slice(first_end, None) if slid[k] else slice(first_end)]
                ways = [n for n in of_end if switches.turns[n][0] == k and switches.turns[n][1] * (two - one) >= 0.0]
                found.append((k, ways[0]))
        return found


@dataclass(eq=False)
class _Choice:
    """The choice of sides of surfaces `among` all, (n,), each at middle -+ half, or sliding at middle."""

    _of: Modes
    _t: float
    _x: Array
    _p: Sequence[float]
    _among: Indices
    _middle: Array
    _half: Array
    _crossed: Array

    def found(self) -> Array | None:
        """Modes that hold; None if none do."""
        n, now = len(self._among), self._of.values[self._among]
        wanted = np.sign(now - self._middle).astype(int).tolist()
        if n > FEW:
            return self._pivoted(wanted)
        options = [[want, -want, 0] if want else [0, 1, -1] for want in wanted]

        def changed(sides: Sequence[int]) -> tuple[int, int]:
            others = [side for side, want in zip(sides, wanted, strict=True) if side != want]
            return others.count(0), len(others)

        for each in sorted(itertools.product(*options), key=changed):
            if not self._wrong(each):
                return self._modes(each)
        return None

    def _modes(self, sides: Sequence[int]) -> Array:
        return np.asarray(self._middle + self._half * np.array(sides))

    @kept_by_first
    def _derivatives(self, order: int, sides: tuple[int, ...]) -> tuple[Array, Array]:
        """Derivatives of the gaps by time with these sides, none of which is 0, and what of it is rounding, (n,) each.

        Of order 1 or 2; 3 stands for the first ones a little later.
        """
        t, x, sizes, modes = self._t, self._x, self._of.sizes, self._of.values.copy()
        modes[self._among] = self._modes(sides)
        fixed = np.array([*self._p, *modes])
        if order == LATER:
            rate = outputs_of(self._of.plain.rate, np.concatenate([x, [t], fixed])[:, None])[: len(x), 0]
            moves = (sizes > 0.0) & (rate != 0.0)
            if moves.any():
                after = self._of.direction * AHEAD * float(np.median(sizes[moves] / np.abs(rate[moves])))
                x, t = x + after * rate, t + after
        m = len(x)  # of a state, its components to both sides and in turn
        ways = np.array([[0.0] * m, [1.0] * m, [1.0 if k % 2 else -1.0 for k in range(m)]]).T
        states = x[:, None] + AT_ONCE * sizes[:, None] * ways
        fixed = np.concatenate([[t], fixed])[:, None]
        points = np.concatenate([states, np.broadcast_to(fixed, (len(fixed), ways.shape[1]))])
        values = outputs_of(_drift(self._of.plain, 2 if order == 2 else 1), points)[self._among]
        values *= 1.0 if order == 2 else self._of.direction
        off = 4.0 * np.abs(values[:, 1:] - values[:, :1]).max(axis=1) + 16.0 * UNIT * np.abs(values[:, 0])
        return values[:, 0], off

    @cached_property
    def _rests(self) -> list[Flags]:
        """Whether the first derivative of each gap, and also the second, is zero on both sides of all surfaces."""
        n, result = len(self._among), list[Flags]()
        for order in (1, 2):
            found = [self._derivatives(order, (side,) * n) for side in (-1, 1)]
            result.append(np.logical_and.reduce([*result, *[np.abs(value) <= off for value, off in found]]))
            if not result[0].any():
                break
        return result

    def _motions(self, sides: tuple[int, ...]) -> tuple[Array, Array]:
        """The first derivatives of the gaps that are not zero on all sides, and what of them is rounding."""
        value, off = self._derivatives(1, sides)
        for order, rests in enumerate(self._rests, 2):
            if rests.any():
                value, off = [
                    np.where(rests, *parts) for parts in zip(self._derivatives(order, sides), (value, off), strict=True)
                ]
        return value, off

    def _wrong(self, sides: tuple[int, ...]) -> list[tuple[int, int]]:
        """Surfaces that do not let the motion go on with these sides, and where they send it."""
        base = tuple([side or -1 for side in sides])
        slides = [k for k, side in enumerate(sides) if side == 0]
        drift, off = self._motions(base)
        wrong = list[tuple[int, int]]()
        if slides:
            columns = [self._motions((*base[:k], 1, *base[k + 1 :]))[0] - drift for k in slides]
            matrix = np.array(columns).T
            with np.errstate(all="ignore"):
                shares = np.linalg.lstsq(matrix[slides], -drift[slides], rcond=None)[0]
                left = np.abs(drift[slides] + matrix[slides] @ shares)
            for i, k in enumerate(slides):
                size = -columns[i][k]
                if not size > off[k] or not left[i] <= SHARE * size + off[k]:
                    wrong.append((k, 1 if drift[k] > 0.0 else -1))
                elif not -(SHARE + off[k] / size) <= shares[i] <= 1.0 + SHARE + off[k] / size:
                    wrong.append((k, 1 if shares[i] > 0.5 else -1))
            drift = drift + matrix @ shares
        for k, side in enumerate(sides):
            if side and not side * drift[k] > off[k]:
                leaves = side * drift[k] < -off[k]
                if leaves or (not (slides or self._rests[0][k]) and side * self._derivatives(2, sides)[0][k] < 0.0):
                    wrong.append((k, -side))
        return wrong

    def _pivoted(self, wanted: Sequence[int]) -> Array | None:
        """Sides by pivots: the first that is wrong slides, or leaves its slide."""
        sides = [0 if not crossed else want for want, crossed in zip(wanted, self._crossed, strict=True)]
        for _ in range(ROUNDS * len(sides)):
            wrong = self._wrong(tuple(sides))
            if not wrong:
                return self._modes(sides)
            k, way = min(wrong)
            sides[k] = way if sides[k] == 0 else 0
        return None


def entries(modes: Modes, before: Turn, after: Turn, point: Array) -> tuple[Graph, ...]:
    """Graphs of the state by which others than the first surface are crossed; point: of the inputs of the rate.

    Motions nearby cross them one after another. Where none hastens another, the second is crossed dt = -g / g' later,
    so that the state after it is x + (f_between - f_after) dt. Raises ValueError where one does: motions nearby part.
    """

    def turned(sides: Sequence[float], k: int) -> list[float]:
        return [*sides[:k], after.modes[k], *sides[k + 1 :]]

    first, *others = modes.crossed(before, after)
    between = turned(before.modes, first[0])
    result = list[Graph]()
    for k, number in others:
        margin, own = modes.margin(before, number), modes.margin(before, first[1])
        if _is_same(margin, own, point) or not is_zero(margin, point, modes.sizes):
            between = turned(between, k)
            continue
        following, alone = turned(between, k), turned(before.modes, k)
        rates = [modes.rate(each) for each in (before.modes, between, alone, following)]
        f, f_between, f_alone, _ = [values_of(rate, point, 1)[:, 0] for rate in rates]
        if not (_moves_alike(margin, point, f, f_between) and _moves_alike(own, point, f, f_alone)):
            names = " and ".join([repr(modes.words[j]) for j in (first[0], k)])
            when = f"cross zero at one instant, t = {after.t:.6g} s, and one hastens the other"
            raise ValueError(f"{names} {when}: motions nearby part there, which has no derivative")
        result.append(_later(modes.plain, margin, rates[1], rates[3], before.modes))
        between = following
    return tuple(result)


def _slopes(margin: Graph, point: Array, m: int) -> Array:
    """Slopes of a margin by states and t."""
    slopes = cg.gradient(margin, list(margin.input_names[: m + 1]))
    return values_of(slopes, point, 1)[:, 0]


def is_zero(margin: Graph, point: Array, sizes: Array) -> bool:
    """Whether a margin is zero there, and not turned by the mode of an earlier one on which it depends."""
    m, value = len(sizes), values_of(margin, point, 1)[0, 0]
    return bool(abs(value) <= ALIKE * (np.abs(_slopes(margin, point, m)) @ np.append(sizes, abs(point[m]))))


def _is_same(a: Graph, b: Graph, point: Array) -> bool:
    """Whether both are zero on the same surface nearby: their slopes are parallel."""
    first, second = [values_of(cg.gradient(each), point, 1)[:, 0] for each in (a, b)]
    product = float(first @ second)
    return abs(abs(product) - float(np.linalg.norm(first) * np.linalg.norm(second))) <= ALIKE**2 * abs(product)


def _moves_alike(margin: Graph, point: Array, f: Array, other: Array) -> bool:
    """Whether a margin moves the same by two rates."""
    slopes = _slopes(margin, point, len(f))
    one, two = [slopes @ np.append(rate, 1.0) for rate in (f, other)]
    return bool(abs(one - two) <= ALIKE * max(abs(one), abs(two)))


def _later(problem: Problem, margin: Graph, between: Graph, after: Graph, modes: Sequence[float]) -> Graph:
    """x + (f_between - f_after) dt, with dt = -g / g'."""
    m, inputs = problem.size, problem.rate.inputs
    known = dict(zip(problem.switches.modes, modes, strict=True))  # type: ignore[union-attr]
    g = cg.specialize(margin, known).only_output()
    slopes = [*cg.gradient(Graph(inputs, {"g": g}), list(problem.rate.input_names[: m + 1])).outputs.values()]
    one, two = list(between.outputs.values()), list(after.outputs.values())
    rate = slopes[m]
    for slope, each in zip(slopes, one, strict=False):
        rate = rate + slope * each
    dt = -g / rate
    moved = [x + (a - b) * dt for x, a, b in zip(inputs, one, two, strict=False)]
    return cg.simplify(numbered_graph(inputs, moved))
