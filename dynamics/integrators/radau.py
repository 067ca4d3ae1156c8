"""Radau IIA of order 5: three implicit stages, solved by simplified Newton with the exact Jacobian, for stiff systems.

Hairer and Wanner II, section IV.8. The stages' increments Z are the rows of Z = T W; in W the Newton equations fall
apart into a real system of the size of the state, (r/h - J), and a complex one, (c/h - J), here real of twice the size.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce

import cgraph as cg
from cgraph import Node
from cgraph.extend import Call, Factor, FixedPoint, If, Solve, Statement, added, copied, effects

from .problem import Problem
from .step import (
    Step,
    Values,
    call,
    combined,
    count,
    each,
    identity,
    jacobian_statements,
    numbered,
    stage_time,
    total,
    weighted,
)
from .step_control import SCALE, measured, nonfinite, scale

_R6 = math.sqrt(6.0)
_C = ((4.0 - _R6) / 10.0, (4.0 + _R6) / 10.0, 1.0)
_REAL = 3.0 + 3.0 ** (2 / 3) - 3.0 ** (1 / 3)  # eigenvalues of A^-1
_COMPLEX = complex(3.0 + 0.5 * (3.0 ** (1 / 3) - 3.0 ** (2 / 3)), 0.5 * (3.0 ** (5 / 6) + 3.0 ** (7 / 6)))
_T = (  # columns: the real eigenvector of A^-1, and the real and imaginary part of the complex one
    (-0.09123239487089298, -0.13132873395769526, -0.0),
    (-0.24171793270710704, 0.25399349123779613, -0.30203528293465726),
    (-0.9660481826150928, 0.8895251640260028, 0.18910246025104693),
)
_T_INVERSE = (
    (-4.325579890063157, -0.33919925181580934, -0.5417705399358749),
    (-4.609554734755688, 0.23563738984600238, 0.3763610775747559),
    (-0.41460941294696624, -2.8412544601545533, 0.7500743514894451),
)
_POWERS = (  # row k has the weights of the Z in the power s^(k+1) of Z(s) / s, the quadratic through the Z at the nodes
    (10.048809399827416, -1.3821427331607492, 0.33333333333333326),
    (-25.62959144707664, 10.296258113743306, -2.6666666666666656),
    (15.580782047249222, -8.914115380582556, 3.3333333333333326),
)
_ERROR = ((-13 - 7 * _R6) / 3, (-13 + 7 * _R6) / 3, -1 / 3)  # weights of Z / h in the estimate
HALVES = (0.9 / 0.5) ** 4  # the error at which a step of estimate h^4 is halved
TURNS = 8.0  # of Newton's iteration, at most
MOST_TURNS = 100.0  # where it goes on to rounding
EPSILON = 2.0**-52  # relative
STALLS = 3.0  # turns that come no nearer: the rest is rounding
FAST = 1e-3  # rate of convergence, below which the Jacobian serves the next step, too (section IV.8)
LONGER_STEP = 1.1  # times as long as the one before: a step up to which is as long, since that saves its factorization
SAME_LENGTH = 1e-10  # relative: lengths of steps that are the same but for the rounding of the time
SMALL_COMPONENT = 1e-6  # of the largest coordinate or velocity, below which a component is measured by it
Z, W, F = (numbered(name, 3) for name in "ZWF")
POWERS, CHANGES = numbered("power", 3, 1), ("right0", "F1", "F2")  # of the guess; of W in a turn


def radau_step(problem: Problem) -> Step:
    """The step, with a guess from the polynomial of the one before."""
    m, slopes = problem.size, jacobian_statements(problem)
    zeros = call(lambda: {"size": [0.0] * m})
    turn: list[Statement] = [
        *_rights(problem),
        Solve("real", "pivots", "right0"),
        call(lambda F1, F2: {"right12": [*F1, *F2]}, F1=m, F2=m),
        Solve("complex", "pivots2", "right12"),
        call(lambda right12: {"F1": right12[:m], "F2": right12[m:]}, right12=2 * m),
        *[added(name, change, name) for name, change in zip(W, CHANGES, strict=True)],
        combined(_T, W, Z),
        added("x", "Z2", "x_new"),
        total(_change, *SCALE, "least", *CHANGES),
        _judged(3 * m),
    ]
    body: list[Statement] = [
        renewed,
        If("renewed", (*slopes, count(1, "jacobians"))),
        _sizes(problem),
        factored,
        If("factored", (*_matrices(m), copied("h", "h_factored"), count(2, "factorizations"))),
        *[stage_time(f"time{k}", _C[k]) for k in range(3)],
        *[_guess(z, c) for z, c in zip(Z, _C, strict=True)],
        combined(_T_INVERSE, Z, W),
        begin,
        FixedPoint("going", tuple(turn)),
        call(lambda failed, converged: {"failed": failed + (1.0 - converged)}),
    ]
    fixed = "jacobian real complex size least rtol atol leap h_old nonfinite_real nonfinite_complex going turns".split()
    fixed += "stalled change change_old exact newton converged failed again sum renewed current slow theta".split()
    fixed += "h_factored factored accepted next jacobians factorizations".split()
    return Step(
        {"size": m},
        body,
        prepare=[Call(problem.rate, ("x", "t", "p"), ("rate",))],
        start=[
            identity(m),
            *[replace(zeros, outputs=(name,)) for name in (*POWERS, "size")],
            call(lambda: {"current": 0.0, "h_factored": 0.0}),  # forgets Jacobian and factors of the step before
        ],
        kept=[combined(_POWERS, Z, POWERS), copied("h", "h_old"), keeping],
        fixed=(*fixed, *POWERS, *effects(slopes)[1]),
        failed="failed",
        error=_estimate(problem),
        estimate=4,
        dense=[combined(_POWERS, Z, ("dense1", "dense2", "dense3"))],
    )


@call
def renewed(current: Node, accepted: Node, slow: Node, h_factored: Node) -> Values:
    """Whether the Jacobian is evaluated: not if it is that of this state, or the last step converged fast by it."""
    fast = accepted * cg.equal(slow, 0.0) * cg.not_equal(h_factored, 0.0)
    result = (1.0 - current) * (1.0 - fast)
    return {"renewed": result, "current": cg.maximum(current, result)}


@call
def factored(h: Node, h_factored: Node, renewed: Node) -> Values:
    """Whether the matrices are made and factored: for another Jacobian, or a step of another length."""
    return {"factored": cg.maximum(renewed, abs(h - h_factored) > SAME_LENGTH * abs(h))}


@call
def keeping(theta: Node, h: Node, next_: Node) -> Values:
    """After an accepted step: whether the Jacobian serves the next, its factors, too, if hardly longer."""
    slow, same = theta > FAST, abs(h)
    alike = (1.0 - slow) * (next_ >= same) * (next_ <= LONGER_STEP * same)
    return {"slow": slow, "current": 0.0, "next": cg.where(alike, same, next_)}


def _sizes(problem: Problem) -> Call:
    """Call for the size of each component so far, and its rounding: of no less than 1e-6 of the largest of its kind."""
    m, nq = problem.size, problem.nq
    kinds = [range(nq), range(nq, m)] if problem.system is not None else [range(k, k + 1) for k in range(m)]

    def sizes(size: list[Node], x: list[Node], rate: list[Node], h: Node) -> Values:
        largest = [cg.maximum(cg.maximum(a, abs(b)), abs(h * c)) for a, b, c in zip(size, x, rate, strict=True)]
        least: list[Node] = []
        for kind in kinds:
            most = reduce(cg.maximum, [largest[k] for k in kind], cg.constant(0.0))
            least += [EPSILON * cg.maximum(largest[k], SMALL_COMPONENT * most) for k in kind]
        return {"size": largest, "least": least}

    return call(sizes, size=m, x=m, rate=m)


def _matrices(m: int) -> list[Statement]:
    """Statements that factor the real matrix of Newton's iteration, and [[a - J, b], [-b, a - J]], of the size 2 m."""

    def complex_matrix(jacobian: list[Node], h: Node) -> Values:
        a, b = _COMPLEX.real / h, _COMPLEX.imag / h
        upper, lower = list[Node | float](), list[Node | float]()
        for k in range(m):
            row = [a - entry if j == k else -entry for j, entry in enumerate(jacobian[k * m : (k + 1) * m])]
            upper += [*row, *[b if j == k else 0.0 for j in range(m)]]
            lower += [*[-b if j == k else 0.0 for j in range(m)], *row]
        return {"complex": [*upper, *lower]}

    return [
        each(lambda unit, h, jacobian: {"real": _REAL / h * unit - jacobian}),
        Factor("real", "pivots"),
        call(complex_matrix, jacobian=m * m),
        Factor("complex", "pivots2"),
    ]


def _guess(z: str, c: float) -> Statement:
    """Z from the polynomial of the step before, carried on."""

    def ahead(h: Node, h_old: Node, *powers: Node) -> Values:
        s = 1.0 + c * cg.where(h_old, h / h_old, 0.0)
        terms = [power * (s ** float(k) - 1.0) for k, power in enumerate(powers, 1)]
        return {z: terms[0] + terms[1] + terms[2]}

    return each(ahead, "h", "h_old", *POWERS)


@call
def begin(rtol: Node) -> Values:
    """Newton's iteration starts: until changes are small beside the tolerance; without one, beside rounding."""
    newton = cg.maximum(10.0 * EPSILON / rtol, cg.minimum(0.03, cg.sqrt(rtol)))
    return {
        "going": 1.0,
        **dict.fromkeys(("turns", "stalled", "converged"), 0.0),
        "change_old": math.inf,
        "exact": cg.equal(rtol, 0.0),
        "newton": cg.where(rtol, newton, 10.0),
    }


def _rights(problem: Problem) -> list[Statement]:
    """The right-hand sides of Newton's equations, T^-1 F(Z) - eigenvalues / h * W."""

    def right(h: Node, w0: Node, w1: Node, w2: Node, *f: Node) -> Values:
        parts = [weighted(f, row) for row in _T_INVERSE]
        a, b = _COMPLEX.real / h, _COMPLEX.imag / h
        return {
            "right0": parts[0] - _REAL / h * w0,
            "F1": parts[1] - (a * w1 + b * w2),
            "F2": parts[2] - (a * w2 - b * w1),
        }

    body: list[Statement] = []
    for k in range(3):
        body += [added("x", Z[k], "at"), Call(problem.rate, ("at", f"time{k}", "p"), (F[k],))]
    return [*body, each(right, "h", *W, *F)]


def _change(x: Node, x_new: Node, rtol: Node, atol: Node, leap: Node, least: Node, *changes: Node) -> Values:
    """The changes of a turn beside the tolerance of the step, or rounding; what starts at 0 is as large as its end."""
    size = cg.where(rtol, scale(x, x_new, rtol, atol, leap), cg.where(least, least, EPSILON * abs(x_new)))
    squares = [cg.where(change, (change / size) * (change / size), 0.0) for change in changes]
    return {"change": squares[0] + squares[1] + squares[2]}


def _judged(numbers: int) -> Call:
    """Whether Newton's iteration goes on, and whether it has converged; beside rounding, if it comes no nearer."""

    def judged(change: Node, change_old: Node, turns: Node, *others: Node) -> Values:
        stalled, exact, newton, evaluations = others
        size = cg.sqrt(change / numbers)
        rate = size / change_old  # 0 in the first turn
        left = rate / (1.0 - rate) * size
        hopeful = (rate < 1.0) * (rate ** (TURNS - 1.0 - turns) / (1.0 - rate) * size <= newton)
        first = cg.equal(turns, 0.0)
        settled = cg.maximum(cg.equal(size, 0.0), (1.0 - first) * (rate < 1.0) * (left < newton))
        finite = size < math.inf
        stalls = stalled + (1.0 - (rate < 1.0))
        hope = cg.where(exact, stalls < STALLS, cg.maximum(first, hopeful))
        going = finite * (1.0 - settled) * hope * (turns + 1.0 < cg.where(exact, MOST_TURNS, TURNS))
        return {
            "going": going,
            "converged": cg.maximum(settled, exact * finite * (stalls >= STALLS)),
            "turns": turns + 1.0,
            "stalled": stalls,
            "change_old": size,
            "theta": rate,
            "evaluations": evaluations + 3.0,
        }

    return call(judged, *"change change_old turns stalled exact newton evaluations".split())


def _estimate(problem: Problem) -> list[Statement]:
    """The error as the real system filters it, twice if the first says no (eq. 8.20); HALVES without convergence."""

    def filtered(rate: str) -> list[Statement]:
        right = each(lambda rate, h, *z: {"error_vector": rate + weighted(z, _ERROR) / h}, rate, "h", *Z)
        return [right, Solve("real", "pivots", "error_vector"), *measured("error_vector", problem.size)]

    def again(error: Node, accepted: Node, h_old: Node) -> Values:
        return {"again": (error > 1.0) * cg.maximum(1.0 - accepted, cg.equal(h_old, 0.0))}

    def finite(error: Node, converged: Node, nonfinite_real: Node, nonfinite_complex: Node) -> Values:
        return {"error": cg.where(converged, error + nonfinite_real + nonfinite_complex, HALVES)}

    rate = Call(problem.rate, ("at", "t", "p"), ("F0",))
    return [
        nonfinite("nonfinite_real", "real"),
        nonfinite("nonfinite_complex", "complex"),
        *filtered("rate"),
        call(again),
        If("again", (added("x", "error_vector", "at"), rate, *filtered("F0"))),
        call(finite),
    ]
