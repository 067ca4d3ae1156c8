"""First step: how long it is, and the sizes of the state by which errors are measured, as statements of a program.

A run writes x, t, p, sized and registers of the start, see `given`. Before its own first trial the program then looks
ahead by Euler's steps, where it is `sized`, for the tolerance that goes with the sizes of the state to come; and tries
steps with a tolerance that anything meets, each whole (`search` = 3) and as two halves (2, 1), until these confirm it;
and so on in `ROUNDS`, as long as the look ahead went much farther than the step. A method that `starts` by itself has
neither: its first trial is as long as it wishes, and sizes are looked at as soon as there are others than the start's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, If, Map, Program, Statement, Sum, While, copied

from ...integrators import Problem
from ...integrators.step_control import COLLAPSE, RESOLUTION, SMALLEST_ATOL
from .state_sizes import OTHERS, StateKinds, at_rest, at_rest_registers

# Registers of its own, whose names no method has to keep clear of, see `_at`
STATES = "x_start rate_start rate_look tolerance size whole pointing x_ahead rate_ahead rate_before size_ahead".split()
STATES += "kind kind_before kind_ahead change way".split()
SINGLE = "t_end goal relative longest_step first instant begins t0 length toward least look reach looking left".split()
SINGLE += "going turn moving moving1 moving2 fine t_ahead jumps halved squares ahead tested rounds h_look h_try".split()
SINGLE += "h_next longest_next is_whole doubts".split()
TOLERANCE = "start.tolerance"  # the register of atol
LEAP = 1e-2  # of the whole run: the first step that is tried
TRIALS = 60.0  # of a first step
AHEAD = 3.0  # times the change of a first step: how far its first rate may point
HUGE = 1e300  # a tolerance that anything meets
ROUNDS = 4.0  # of a first step, by which the sizes of the states are known
HALVINGS = 100.0  # of a look ahead
JUMP = 1e-2  # of the longest of the last steps: how much of it a jump may take, where atol is chosen by sizes
SUDDEN = 1e-3  # of a kind of rate: a force that jumps at the start changes it by more
FIRST_LOOK = 32.0  # trials, after which atol is raised to the sizes so far; then after twice as many
AT_ONCE = 1.0  # the same where no look ahead has found sizes
WHOLE, FIRST_HALF, SECOND_HALF = 3.0, 2.0, 1.0  # register `search`

Values = dict[str, "Node | float"]


def given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of registers with which a run begins, besides x, t, p and sized.

    t_end, goal: its end, and where its steps end first.  relative, tolerance: rtol and atol.  longest_step: the limit.
    first: a first step, 0 without one.  instant: what moves the time.
    """
    return {_at(name): value for name, value in values.items()} | {_at("begins"): 1.0, "anew": 1.0}


def instant(t0: float, t_end: float) -> float:
    """The time after which a force that jumps at the start has jumped [s]."""
    return max(math.ulp(t0), COLLAPSE * abs(t_end - t0))


def with_first_step(steps: Program, problem: Problem, kinds: StateKinds, order: int, *, starts: bool) -> Program:
    """Chosen steps, of a method of this order, with the first one and the tolerances of a run that was given none.

    starts: whether the method needs no search for it, see `Method`.
    """
    m = problem.size
    own = {_at(name): m if name in STATES else 1 for name in (*STATES, *SINGLE)}
    if starts:
        found, turn = [If(_at("begins"), (*_begin(), *_as_wished(kinds)))], []
    else:
        found = [If(_at("begins"), (*_begin(), *_rates_at_start(problem, kinds))), _look(problem, kinds)]
        turn = [If("search", _turn(m, order), seldom=True)]
    set_out = If("anew", (*found, *_set_out(problem, AT_ONCE if starts else FIRST_LOOK)), seldom=True)
    later = _rule("seen", lambda n: {"seen": 2.0 * n, "due": 0.0})
    raised = (*_tolerance(kinds), *at_rest(kinds), _copy("tolerance", "atol"), later)
    sizes = [If("row", (_over(_LARGER, "size x", "size"),)), If("due", raised, seldom=True)]
    registers = {**steps.registers, **own, **at_rest_registers(kinds)}
    return replace(steps, registers=registers, body=[set_out, *steps.body, *turn, *sizes])


def _graph(names: str, rule: Callable[..., Node]) -> Graph:
    inputs = cg.variables(names.split())
    return Graph(inputs, {"y": rule(*inputs)})


def _size(x: Node) -> Node:
    return cg.where(abs(x) < math.inf, abs(x), 0.0)


def _by_sizes(rtol: Node, size: Node, kind: Node) -> Node:
    return cg.maximum(rtol * cg.maximum(size, OTHERS * kind), SMALLEST_ATOL)


_LARGER = _graph("size x", lambda size, x: cg.maximum(size, _size(x)))
_DIFFERENCE = _graph("a b", lambda a, b: a - b)
_TOLERANCE = _graph("rtol size kind", _by_sizes)


def _at(name: str) -> str:
    """The register of that name, of the start or of all steps."""
    return f"start.{name}" if name in STATES or name in SINGLE else name


def _all(names: str) -> tuple[str, ...]:
    return tuple([_at(name) for name in names.split()])


def _copy(source: str, target: str) -> Map:
    return copied(_at(source), _at(target))


def _rate(problem: Problem, x: str, t: str, target: str) -> Call:
    """A rate of which what cancels is 0: the looks ahead tell what rests from what moves."""
    return Call(problem.rate, (_at(x), _at(t), "p"), (_at(target),), exact=True)


def _rule(names: str, rule: Callable[..., Values]) -> Call:
    """Registers by a rule of others, of one number each."""
    inputs = cg.variables(names.split())
    outputs = rule(*inputs)
    return Call(Graph(inputs, outputs), _all(names), _all(" ".join(outputs)))


def _map(names: str, target: str, rule: Callable[..., Node]) -> Map:
    """A register by a rule of others, number by number."""
    return _over(_graph(names, rule), names, target)


def _over(graph: Graph, names: str, target: str) -> Map:
    """A register by a graph of others, number by number."""
    return Map(graph, _all(names), (_at(target),))


def _sum(names: str, target: str, rule: Callable[..., Node]) -> Sum:
    """The sum of a rule over the numbers of registers."""
    return Sum(_graph(names, rule), _all(names), _at(target))


def _largest(kinds: StateKinds, source: str, target: str) -> Call:
    """Largest size among components of one kind, for each component."""
    return Call(kinds.largest, (_at(source),), (_at(target),))


def _tolerance(kinds: StateKinds) -> list[Statement]:
    """Register `tolerance`, in the units of the states, by the sizes so far.

    rtol times the largest value that the component, or another of its group, has had, or a ten-thousandth of the
    largest of its kind, coordinates or velocities, angles and lengths compared by their `lengths`.
    """
    grouped = [] if kinds.together is None else [Call(kinds.together, (_at("size"),), (_at("size"),))]
    return [*grouped, _largest(kinds, "size", "kind"), _over(_TOLERANCE, "relative size kind", "tolerance")]


def _first_try(length: Node, longest: Node, least: Node) -> Node:
    return cg.maximum(LEAP * cg.minimum(length, longest), least)


def _begin() -> list[Statement]:
    """What a run begins with: its start, and whether to look ahead, to search, or to set out."""

    def begun(t: Node, t_end: Node, first: Node, sized: Node, longest: Node) -> Values:
        length = abs(t_end - t)
        least = cg.minimum(length, cg.maximum(2.0 * RESOLUTION * abs(t), math.ulp(0.0)))
        h_try = _first_try(length, longest, least)
        return {
            "t0": t,
            "length": length,
            "toward": cg.where(t_end > t, 1.0, -1.0),
            "least": least,
            "h_look": cg.where(first, first, LEAP * cg.minimum(length, longest)),
            "look": sized,
            "search": cg.where(cg.maximum(sized, first), 0.0, WHOLE),
            "h_try": h_try,
            "h_next": cg.where(first, first, h_try),
            "longest_next": 0.0,
            "tested": 0.0,
            "rounds": 0.0,
            "begins": 0.0,
            "jumps": 0.0,
        }

    return [_copy("x", "x_start"), _rule("t t_end first sized longest_step", begun)]


def _as_wished(kinds: StateKinds) -> list[Statement]:
    """No search: the first trial is as long as the method wishes, by sizes of the start alone."""
    wish = _rule("first length", lambda first, length: {"h_next": cg.where(first, first, length), "search": 0.0})
    return [wish, If("sized", (_map("x_start", "size", _size), *_tolerance(kinds)))]


def _rates_at_start(problem: Problem, kinds: StateKinds) -> list[Statement]:
    """The rate at the start; of a force that jumps there, right after it: it changes in the first instant, no more."""

    def jumps(first: Node, after: Node, later: Node, kind: Node, kind_after: Node) -> Node:
        least = SUDDEN * cg.maximum(kind, kind_after)
        return (abs(after - first) > least) * (abs(later - after) <= least)

    body: list[Statement] = [_rate(problem, "x", "t", "rate_start"), _copy("rate_start", "rate_look")]
    if not problem.timed:
        return body
    for k, target in ((1.0, "rate_ahead"), (2.0, "rate_before")):
        instant = _rule("t toward instant", lambda t, toward, instant, k=k: {"t_ahead": t + toward * (k * instant)})
        body += [instant, _rate(problem, "x", "t_ahead", target)]
    body += [_largest(kinds, "rate_start", "kind"), _largest(kinds, "rate_ahead", "kind_ahead")]
    body.append(_sum("rate_start rate_ahead rate_before kind kind_ahead", "jumps", jumps))
    return [*body, If(_at("jumps"), (_copy("rate_ahead", "rate_look"),))]


def _look(problem: Problem, kinds: StateKinds) -> If:
    """The sizes of x and of where Euler's steps lead to, of h_look or of so much less that they can be trusted.

    They move no kind of component by more than its size, and turn no kind of rate: it changes by no more than the
    larger of before and after. `reach` is their length.
    """
    start = [
        _copy("x_start", "x_ahead"),
        _copy("rate_look", "rate_ahead"),
        _map("x_start", "size_ahead", _size),
        _rule("", lambda: {"going": 1.0, "turn": 0.0, "moving": 0.0, "moving1": 0.0, "moving2": 0.0}),
    ]
    shorter = _rule(
        "fine left reach",
        lambda fine, left, reach: {
            "left": left - 1.0,
            "looking": (1.0 - fine) * (left > 1.0),
            "reach": cg.where(fine, reach, 0.25 * reach),
        },
    )

    def seen(jumps: Node, first: Node, reach: Node, length: Node, longest: Node, least: Node) -> Values:
        h_try = _first_try(length, longest, least)
        return {
            "look": 0.0,
            "tested": 0.0,
            "search": cg.where(cg.maximum(first, jumps), 0.0, WHOLE),
            "h_try": h_try,
            # halving steps only leads to a jump; step control passes it, as any later one
            "h_next": cg.where(first, first, cg.where(jumps, reach, h_try)),
            "longest_next": cg.maximum(first, reach),
        }

    return If(
        _at("look"),
        (
            _largest(kinds, "x_start", "kind"),
            _rule("h_look", lambda h: {"reach": h, "left": HALVINGS, "looking": 1.0}),
            While(_at("looking"), (*start, While(_at("going"), tuple(_euler(problem, kinds))), shorter)),
            _map("fine size_ahead x_start", "size", lambda fine, size, x: cg.where(fine, size, _size(x))),
            *_tolerance(kinds),
            _rule("jumps first reach length longest_step least", seen),
        ),
    )


def _euler(problem: Problem, kinds: StateKinds) -> list[Statement]:
    """One of Euler's steps; two of them, or as many as move all that moves, are `going`.

    At rest each step may move one component more, the next of a chain; the first moves none where a force begins at 0.
    """

    def doubtful(way: Node, size: Node, change: Node, before: Node, after: Node) -> Node:
        near = cg.maximum(way <= size, cg.equal(size, 0.0))
        return 1.0 - near * (change <= cg.maximum(before, after))

    def counted(moving: Node, moving1: Node, moving2: Node, doubts: Node, turn: Node) -> Values:
        fine, more = cg.equal(doubts, 0.0), cg.maximum(turn < 2.0, (moving < m) * (moving > moving2))
        return {"fine": fine, "going": fine * more, "moving1": moving, "moving2": moving1}

    def next_time(t: Node, turn: Node, toward: Node, h: Node) -> Values:
        return {"t_ahead": t + (turn + 1.0) * (toward * h), "turn": turn + 1.0}

    m = problem.size
    return [
        _map("x_ahead toward reach rate_ahead", "x_ahead", lambda x, toward, h, rate: x + toward * h * rate),
        _sum("x_ahead", "moving", lambda x: cg.not_equal(x, 0.0)),
        _copy("rate_ahead", "rate_before"),
        _largest(kinds, "rate_ahead", "kind_before"),
        _rule("t0 turn toward reach", next_time),
        _rate(problem, "x_ahead", "t_ahead", "rate_ahead"),
        _largest(kinds, "rate_ahead", "kind_ahead"),
        _over(_DIFFERENCE, "rate_ahead rate_before", "change"),
        _largest(kinds, "change", "change"),
        _over(_DIFFERENCE, "x_ahead x_start", "way"),
        _largest(kinds, "way", "way"),
        _sum("way kind change kind_before kind_ahead", "doubts", doubtful),
        _over(_LARGER, "size_ahead x_ahead", "size_ahead"),
        _rule("moving moving1 moving2 doubts turn", counted),
    ]


def _set_out(problem: Problem, first_look: float) -> list[Statement]:
    """The next trial is from the start: one of the search, with a tolerance that anything meets, or the first."""

    def limits(search: Node, *given: Node) -> Values:
        t, goal, toward, length, h, longest, relative, max_step, sized = given
        return {
            "t": t,
            "t_old": t,
            "next": h,
            "end": cg.where(search, toward * math.inf, goal),
            "rtol": cg.where(search, HUGE, relative),
            "max_step": cg.where(search, math.inf, max_step),
            "min_step": cg.where(search, 0.0, COLLAPSE * length),
            "jump": cg.where(search, 0.0, JUMP * sized),
            "longest": cg.where(search, 0.0, longest),
            "still": LEAP * length if problem.timed else math.inf,
            "error_old": cg.where(search, 1.0, 1e-4),
            "fresh": 1.0,
            "accepted": 1.0,
            "seen": first_look,
            **dict.fromkeys("status rejected evaluations at_limit trials".split(), 0.0),
            **({} if problem.projection is None else {"farthest": 0.0}),
        }

    names = "search t0 goal toward length h_next longest_next relative longest_step sized"
    atol = _map("search tolerance", "atol", lambda search, tolerance: cg.where(search, HUGE, tolerance))
    return [_copy("x_start", "x"), _copy("x_start", "x_old"), _rule(names, limits), atol]


def _turn(m: int, order: int) -> tuple[Statement, ...]:
    """Turn of the search after a trial: the next one, or whether its step is confirmed.

    The estimate of an embedded method can vanish by symmetry, such as at a start from rest, and a guess from the first
    derivatives can be far off; halving cannot be fooled by either. Of an initial layer that a method damps, both the
    whole and the half steps keep nothing: there the first rate points much farther than the step goes.
    """

    def kinds(search: Node, accepted: Node) -> Values:
        return {
            "is_whole": cg.equal(search, WHOLE),
            "halved": cg.maximum(cg.equal(search, SECOND_HALF), cg.equal(search, FIRST_HALF) * (1.0 - accepted)),
        }

    def half(search: Node, h: Node) -> Values:
        ahead = {"next": 0.5 * h, "h_next": 0.5 * h}
        return {**ahead, "anew": cg.equal(search, WHOLE), "search": search - 1.0, "status": 0.0}

    def scale(whole: Node, start: Node, tolerance: Node, relative: Node) -> Node:
        return tolerance + relative * cg.maximum(abs(start), abs(whole))

    def square(x: Node, accepted: Node, whole: Node, *sizes: Node) -> Node:
        change = (whole - cg.where(accepted, x, math.inf)) / scale(whole, *sizes)
        return change * change

    def pointing(h: Node, rate: Node, whole: Node, start: Node, *tolerance: Node) -> Node:
        return h * abs(rate) / cg.maximum(abs(whole - start), scale(whole, start, *tolerance))

    each = cg.variables([f"x{k}" for k in range(m)])
    farthest = Graph(each, {"y": reduce(cg.maximum, each)})
    confirmed = (
        _sum("x accepted whole x_start tolerance relative", "squares", square),
        _map("h_try rate_start whole x_start tolerance relative", "pointing", pointing),
        Call(farthest, (_at("pointing"),), (_at("ahead"),)),
        _confirmed(m, order),
    )
    return (
        _rule("search accepted", kinds),
        _map(
            "is_whole accepted x whole",
            "whole",
            lambda here, accepted, x, whole: cg.where(here, cg.where(accepted, x, math.inf), whole),
        ),
        If(_at("halved"), confirmed, (_rule("search h_try", half),)),
    )


def _confirmed(m: int, order: int) -> Call:
    """Whether two half steps confirm a step, their difference is within the tolerance, and the first rate, too."""

    def rule(squares: Node, ahead: Node, h: Node, *given: Node) -> Values:
        least, tested, sized, rounds, h_look, reach = given
        difference = cg.sqrt(squares / m)
        found = cg.maximum((difference <= 1.0) * (ahead <= AHEAD), h <= least)
        # of tolerances; below a rounding, as of a state that moves evenly, it does not limit the step
        factor = 0.9 * cg.maximum(difference, 1e-16) ** (-1.0 / (order + 1))
        factor = cg.where(difference < math.inf, factor, 0.0)
        factor = cg.where(ahead > AHEAD, cg.minimum(factor, AHEAD / ahead), factor)
        shorter = cg.maximum(h * cg.minimum(0.5, cg.maximum(1e-3, factor)), least)
        h_next = cg.where(found, h, shorter)
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

    return _rule("squares ahead h_try least tested sized rounds h_look reach", rule)
