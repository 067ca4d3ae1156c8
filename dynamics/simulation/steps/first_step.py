"""First step: how long it is, and the sizes of the state by which errors are measured, as statements of a program.

Before its own first trial a run looks ahead by Euler's steps, where it is `sized`, for the tolerance that goes with the
sizes of the state to come; tries steps with a tolerance that anything meets, each whole (`search` = 3) and as two
halves (2, 1), until these confirm it; and so on in `ROUNDS`, as long as the look ahead went much farther than the step.
A method that `starts` has neither.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import cgraph as cg
from cgraph import Node
from cgraph._shared import with_names
from cgraph.extend import STATEMENTS, Call, If, Program, Statement, While, copied

from ...integrators import Problem
from ...integrators.step import Values, call, each, lengths_of, total
from ...integrators.step_control import COLLAPSE, RESOLUTION, SMALLEST_ATOL, registers
from .state_sizes import OTHERS, StateKinds

START = "start."  # before the names of its own registers, so that no method has to keep clear of them
# Those that a run writes: its end, where its steps end first, rtol, limit, first step, that which is tried first.
GIVEN = "t_end goal relative longest_step first wish begins".split()
TOLERANCE = f"{START}tolerance"  # the register of atol
LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60.0  # of a first step
AHEAD = 3.0  # times the change of a first step: how far its first rate may point
HUGE = 1e300  # a tolerance that anything meets
ROUNDS = 4.0  # of a first step, by which the sizes of the states are known
HALVINGS = 100.0  # of a look ahead
JUMP = 1e-2  # of the longest of the last steps: how much of it a jump may take, where atol is chosen by sizes
FIRST_LOOK = 32.0  # trials, after which atol is raised to the sizes so far; then after twice as many
AT_ONCE = 1.0  # the same where no look ahead has found sizes
STILL = 2.0**-54  # of a coordinate, a quarter of its last digit: a step that moves it by less does not move it
WHOLE, FIRST_HALF, SECOND_HALF = 3.0, 2.0, 1.0  # register `search`


def start_registers(values: Mapping[str, Any]) -> dict[str, Any]:
    """Registers with which a run begins, besides x, t, p and sized: `GIVEN` and tolerance, its atol."""
    return {f"{START}{name}": value for name, value in {**values, "begins": 1.0}.items()} | {"anew": 1.0}


def with_first_step(steps: Program, problem: Problem, kinds: StateKinds, order: int, *, starts: bool) -> Program:
    """Chosen steps, of a method of this order, with the first one and the tolerances of a run that was given none."""
    tolerance, after = _tolerance(kinds), list[Statement]()
    lowered = () if kinds.floor is None else (each(lambda x_start: {"floor": cg.constant(0.0)}),)
    begins = (copied("x", "x_start"), begin, *lowered)
    if starts:  # the first trial is as long as the method wishes, by sizes of the start alone
        nothing = {"search": 0.0, "longest_next": 0.0}
        wish = call(lambda first, length: {"h_next": cg.where(first, first, length), **nothing})
        sizes = If("sized", (each(lambda x_start, so_far: {"size": cg.maximum(so_far, _size(x_start))}), *tolerance))
        found = [If("begins", (*begins, wish, sizes))]
    else:
        rate = _rate(problem, "x", "t", "rate_start")
        found = [If("begins", (*begins, *rate)), If("look", (If("sized", _look(problem, kinds, tolerance)), searched))]
        after.append(If("search", _turn(problem.size, order), seldom=True))
    later = call(lambda seen: {"seen": 2.0 * seen, "due": 0.0})
    raised = (*tolerance, *_at_rest(kinds), copied("tolerance", "atol"), later)
    larger = each(lambda size, x: {"size": cg.maximum(size, _size(x))})
    after += [If("row", (larger,)), If("due", raised, seldom=True)]
    before = [If("anew", (*found, *_set_out(problem, AT_ONCE if starts else FIRST_LOOK)), seldom=True)]
    shared = {*registers(problem), "farthest", *problem.evaluation.lengths}
    first, last = (_of_start(part, shared) for part in (before, after))
    known = {**steps.registers, **{f"{START}{name}": 1 for name in GIVEN}, f"{START}so_far": problem.size}
    return replace(steps, registers=lengths_of([*first, *last], known), body=[*first, *steps.body, *last])


def _of_start(statements: Sequence[Statement], shared: Collection[str]) -> tuple[Statement, ...]:
    """The statements, whose registers but the shared ones are those of the start."""
    result = []
    for statement in statements:
        row = STATEMENTS[type(statement)]
        bodies: dict[str, Any] = {body: _of_start(getattr(statement, body), shared) for body in row.bodies}
        named = with_names(statement, lambda name: name if name in shared else f"{START}{name}")
        result.append(replace(named, **bodies))
    return tuple(result)


def _size(x: Node) -> Node:
    return cg.where(abs(x) < math.inf, abs(x), 0.0)


def _so_far(fine: Node, ahead: Node, x: Node, before: Node) -> Node:
    """The largest of the size ahead, if that is to be trusted, or else of the state, and that of steps before."""
    return cg.maximum(before, cg.where(fine, ahead, _size(x)))


def _rate(problem: Problem, x: str, t: str, target: str) -> list[Statement]:
    """A rate of which what cancels is 0: the looks ahead tell what rests from what moves."""
    return problem.evaluation.at(x, t, target, exact=True)


def _tolerance(kinds: StateKinds) -> tuple[Statement, ...]:
    """Register `tolerance` by the sizes so far: of the component or its group, or OTHERS of the largest of its kind.

    No less than rounding does to a state at rest within the first step that a look ahead trusts.
    """

    def by_sizes(relative: Node, size: Node, kind: Node) -> Values:
        return {"tolerance": cg.maximum(relative * cg.maximum(size, OTHERS * kind), SMALLEST_ATOL)}

    grouped = () if kinds.together is None else (Call(kinds.together, ("size",), ("size",)),)
    known = (*grouped, Call(kinds.largest, ("size",), ("kind",)), each(by_sizes))
    if kinds.floor is None:
        return known
    lowest = each(lambda floor, rounded: {"floor": cg.maximum(floor, rounded)})  # of the longest of looks ahead
    raised = each(lambda tolerance, floor: {"tolerance": cg.maximum(tolerance, floor)})
    return (*known, Call(kinds.floor, ("reach",), ("rounded",)), lowest, raised)


def _at_rest(kinds: StateKinds) -> list[Statement]:
    """Raise the tolerance of velocities that in a mean step so far do not move any coordinate: they may be rounding."""

    def still(resting: Node, kind: Node, mean: Node, coordinate: Node, relative: Node, length: Node) -> Values:
        rests = (kind > 0.0) * (mean > 0.0) * (kind * mean <= STILL * coordinate)
        return {"resting": cg.maximum(resting, cg.where(rests, relative * coordinate / length, 0.0))}

    if not any(kinds.moved):
        return []
    return [
        Call(kinds.coordinate, ("size",), ("coordinate",)),
        call(lambda t, t0, trials: {"mean": abs(t - t0) / trials}),
        each(still),
        each(lambda tolerance, resting: {"tolerance": cg.maximum(tolerance, resting)}),
    ]


@call
def begin(t: Node, t_end: Node, first: Node, wish: Node, longest_step: Node) -> Values:
    """What a run begins with."""
    length = abs(t_end - t)
    h_first = cg.where(wish, cg.minimum(wish, length), LEAP * cg.minimum(length, longest_step))
    return {
        "t0": t,
        "length": length,
        "toward": cg.where(t_end > t, 1.0, -1.0),
        "least": cg.minimum(length, cg.maximum(2.0 * RESOLUTION * abs(t), 2.0**-1022)),
        "h_first": h_first,
        "h_look": cg.where(first, first, h_first),
        "look": 1.0,
        "reach": h_first,
        **dict.fromkeys("rounds begins".split(), 0.0),
    }


def _look(problem: Problem, kinds: StateKinds, tolerance: Sequence[Statement]) -> tuple[Statement, ...]:
    """The sizes of x and of where Euler's steps lead to, of h_look or as much less as can be trusted, `reach`."""

    def shorter(fine: Node, left: Node, reach: Node) -> Values:
        return {"left": (1.0 - fine) * (left - 1.0), "reach": cg.where(fine, reach, 0.25 * reach)}

    rounded = () if kinds.floor is None else (Call(kinds.floor, ("reach",), ("rounded",)),)
    euler = (
        *rounded,
        copied("x_start", "x_ahead"),
        copied("rate_start", "rate_ahead"),
        each(lambda x_start: {"size_ahead": _size(x_start)}),
        call(lambda: {"going": 1.0, **dict.fromkeys("turn moving moving1 moving2".split(), 0.0)}),
        While("going", _euler(problem, kinds)),
    )
    return (
        Call(kinds.largest, ("x_start",), ("kind",)),
        call(lambda h_look: {"reach": h_look, "left": HALVINGS}),
        While("left", (*euler, call(shorter))),
        each(lambda fine, size_ahead, x_start, so_far: {"size": _so_far(fine, size_ahead, x_start, so_far)}),
        *tolerance,
    )


@call
def searched(sized: Node, first: Node, reach: Node, h_first: Node, least: Node) -> Values:
    """Whether to search or to set out."""
    h_try = cg.maximum(h_first, least)
    return {
        "look": 0.0,
        "tested": 0.0,
        "search": cg.where(first, 0.0, WHOLE),
        "h_try": h_try,
        "h_next": cg.where(first, first, h_try),
        "longest_next": cg.where(sized, cg.maximum(first, reach), 0.0),
    }


def _euler(problem: Problem, kinds: StateKinds) -> tuple[Statement, ...]:
    """One of Euler's steps; two of them, or as many as move all that moves, are `going`, as of a chain at rest."""

    def doubtful(way: Node, kind: Node, change: Node, kind_before: Node, kind_ahead: Node, *rounded: Node) -> Values:
        near = cg.maximum(way <= kind, cg.equal(kind, 0.0))
        doubts = 1.0 - near * (change <= cg.maximum(kind_before, kind_ahead))
        if rounded:
            reach, floor = rounded
            doubts = doubts * (reach * change > floor)
        return {"doubts": doubts}

    def counted(moving: Node, moving1: Node, moving2: Node, doubts: Node, turn: Node) -> Values:
        fine = cg.equal(doubts, 0.0)
        more = cg.maximum(turn < 2.0, (moving < problem.size) * (moving > moving2))
        return {"fine": fine, "going": fine * more, "moving1": moving, "moving2": moving1}

    names = "way kind change kind_before kind_ahead".split() + ["reach", "rounded"] * (kinds.floor is not None)
    return (
        each(lambda x_ahead, toward, reach, rate_ahead: {"x_ahead": x_ahead + toward * reach * rate_ahead}),
        total(lambda x_ahead: {"moving": cg.not_equal(x_ahead, 0.0)}),
        copied("rate_ahead", "rate_before"),
        Call(kinds.largest, ("rate_ahead",), ("kind_before",)),
        call(lambda t0, turn, toward, reach: {"t_ahead": t0 + (turn + 1.0) * (toward * reach), "turn": turn + 1.0}),
        *_rate(problem, "x_ahead", "t_ahead", "rate_ahead"),
        Call(kinds.largest, ("rate_ahead",), ("kind_ahead",)),
        each(lambda rate_ahead, rate_before: {"change": rate_ahead - rate_before}),
        Call(kinds.largest, ("change",), ("change",)),
        each(lambda x_ahead, x_start: {"way": x_ahead - x_start}),
        Call(kinds.largest, ("way",), ("way",)),
        total(doubtful, *names),
        each(lambda size_ahead, x_ahead: {"size_ahead": cg.maximum(size_ahead, _size(x_ahead))}),
        call(counted),
    )


def _set_out(problem: Problem, first_look: float) -> list[Statement]:
    """The next trial is from the start: one of the search, with a tolerance that anything meets, or the first."""

    def limits(search: Node, t0: Node, goal: Node, toward: Node, length: Node, h_next: Node, *others: Node) -> Values:
        longest_next, relative, longest_step, sized = others
        return {
            **dict.fromkeys(("t", "t_old"), t0),
            "next": h_next,
            "end": cg.where(search, toward * math.inf, goal),
            "rtol": cg.where(search, HUGE, relative),
            "max_step": cg.where(search, math.inf, longest_step),
            "min_step": cg.where(search, 0.0, COLLAPSE * length),
            "jump": cg.where(search, 0.0, JUMP * sized),
            "longest": cg.where(search, 0.0, longest_next),
            "still": LEAP * length if problem.timed else math.inf,
            "error_old": cg.where(search, 1.0, 1e-4),
            **dict.fromkeys(("fresh", "accepted"), 1.0),
            "seen": first_look,
            **dict.fromkeys("status rejected evaluations at_limit trials".split(), 0.0),
            **({} if problem.projection is None else {"farthest": 0.0}),
        }

    names = "search t0 goal toward length h_next longest_next relative longest_step sized".split()
    atol = each(lambda search, tolerance: {"atol": cg.where(search, HUGE, tolerance)})
    return [copied("x_start", "x"), copied("x_start", "x_old"), call(limits, *names), atol]


def _turn(m: int, order: int) -> tuple[Statement, ...]:
    """Turn of the search after a trial: the next one, or whether its step is confirmed.

    Estimates of embedded methods can vanish by symmetry, such as at rest, and whole and half steps keep nothing of a
    layer that a method damps: there the first rate points farther.
    """

    def halves(search: Node, accepted: Node) -> Values:
        first = cg.equal(search, FIRST_HALF) * (1.0 - accepted)
        return {"halved": cg.maximum(cg.equal(search, SECOND_HALF), first)}

    def arrived(search: Node, accepted: Node, x: Node, whole: Node) -> Values:
        return {"whole": cg.where(cg.equal(search, WHOLE), cg.where(accepted, x, math.inf), whole)}

    def half(search: Node, h_try: Node) -> Values:
        ahead = {"next": 0.5 * h_try, "h_next": 0.5 * h_try}
        return {**ahead, "anew": cg.equal(search, WHOLE), "search": search - 1.0, "status": 0.0}

    def scale(whole: Node, x_start: Node, tolerance: Node, relative: Node) -> Values:
        return {"scale": tolerance + relative * cg.maximum(abs(x_start), abs(whole))}

    def squares(x: Node, accepted: Node, whole: Node, scale: Node) -> Values:
        change = (whole - cg.where(accepted, x, math.inf)) / scale
        return {"squares": change * change}

    def pointing(h_try: Node, rate_start: Node, whole: Node, x_start: Node, scale: Node) -> Values:
        return {"pointing": h_try * abs(rate_start) / cg.maximum(abs(whole - x_start), scale)}

    def confirmed(squares: Node, pointing: list[Node], h: Node, *others: Node) -> Values:
        """Whether two half steps confirm a step, their difference is within the tolerance, and the first rate, too."""
        least, tested, sized, rounds, h_look, reach = others
        difference, ahead = cg.sqrt(squares / m), reduce(cg.maximum, pointing)
        found = cg.maximum((difference <= 1.0) * (ahead <= AHEAD), h <= least)
        # of tolerances; below a rounding, as of a state that moves evenly, it does not limit the step
        factor = 0.9 * cg.maximum(difference, 1e-16) ** (-1.0 / (order + 1))
        factor = cg.where(difference < math.inf, factor, 0.0)
        factor = cg.where(ahead > AHEAD, cg.minimum(factor, AHEAD / ahead), factor)
        h_next = cg.where(found, h, cg.maximum(h * cg.minimum(0.5, cg.maximum(1e-3, factor)), least))
        ends = cg.maximum(found, tested + 1.0 >= TRIALS)
        again = sized * ends * (h_next < 0.5 * h_look) * (rounds + 1.0 < ROUNDS)
        return {
            "h_next": h_next,
            "h_try": h_next,
            "longest_next": cg.where(sized, cg.maximum(h_next, reach), 0.0),
            "search": cg.where(ends, 0.0, WHOLE),
            "look": again,
            "h_look": cg.where(again, h_next, h_look),
            "tested": tested + 1.0,
            "rounds": rounds + ends,
            "anew": 1.0,
            "status": 0.0,
        }

    names = "squares pointing h_try least tested sized rounds h_look reach".split()
    judged = (each(scale), total(squares), each(pointing), call(confirmed, *names, pointing=m))
    return (call(halves), each(arrived), If("halved", judged, (call(half),)))
