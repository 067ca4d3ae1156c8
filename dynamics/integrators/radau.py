"""Radau IIA of order 5: three implicit stages, solved by simplified Newton with the exact Jacobian, for stiff systems.

Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.8. The stages' increments Z are the rows of
Z = T W; in W the Newton equations fall apart into one real system of the size of the state, (r/h - J), and a complex
one, (c/h - J), here as a real one of twice the size. While the iteration converges fast the Jacobian stays, and while
steps are alike the factors do.
"""

from __future__ import annotations

import math
from functools import reduce

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, Factor, FixedPoint, If, Map, Solve, Statement, Sum, added, copied

from .elementwise import combined, end_to_end, identity, stage_time, weighted
from .jacobian_statements import jacobian_statements
from .problem import Problem
from .step import Step
from .step_control import SCALE, count, measured, nonfinite, scale
from .tableau import RowOfWeights

_R6 = math.sqrt(6.0)
_C = ((4.0 - _R6) / 10.0, (4.0 + _R6) / 10.0, 1.0)
_A = np.array(
    [
        [(88 - 7 * _R6) / 360, (296 - 169 * _R6) / 1800, (-2 + 3 * _R6) / 225],
        [(296 + 169 * _R6) / 1800, (88 + 7 * _R6) / 360, (-2 - 3 * _R6) / 225],
        [(16 - _R6) / 36, (16 + _R6) / 36, 1 / 9],
    ]
)
_REAL = 3.0 + 3.0 ** (2 / 3) - 3.0 ** (1 / 3)  # eigenvalues of the inverse of A
_COMPLEX = complex(3.0 + 0.5 * (3.0 ** (1 / 3) - 3.0 ** (2 / 3)), 0.5 * (3.0 ** (5 / 6) + 3.0 ** (7 / 6)))
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
CHANGES = ("right0", "F1", "F2")  # of W in a turn


def _transformation() -> tuple[list[RowOfWeights], list[RowOfWeights]]:
    """T and its inverse: columns the real eigenvector of A^-1, and the real and imaginary part of the complex one."""
    inverse = np.linalg.inv(_A)
    columns = []
    for value in (_REAL, _COMPLEX):
        shifted = inverse - value * np.eye(3)
        vector = np.linalg.svd(shifted)[2][-1].conj()  # of the smallest singular value, which is 0
        columns += [vector.real] if value == _REAL else [vector.real, vector.imag]
    t = np.array(columns).T
    return [tuple(row) for row in t.tolist()], [tuple(row) for row in np.linalg.inv(t).tolist()]


_T, _T_INVERSE = _transformation()
# Z(s) / s at the nodes c is a quadratic in s: its coefficients, row k of weights of the Z in the power s^(k+1).
_POWERS = [tuple(row) for row in (np.linalg.inv(np.vander(_C, 3, increasing=True)) / np.array(_C)).tolist()]


def radau_step(problem: Problem) -> Step:
    """The step, with a guess from the polynomial of the one before."""
    m = problem.size
    z, w, f = (tuple([f"{name}{k}" for k in range(3)]) for name in ("Z", "W", "F"))
    powers = tuple([f"power{k + 1}" for k in range(3)])
    slopes, on_the_way = jacobian_statements(problem)
    factor = [*_matrices(m), copied("h", "h_factored"), count(2, "factorizations")]
    body: list[Statement] = [
        _renewed(),
        If("renewed", (*slopes, count(1, "jacobians"))),
        _sizes(problem),
        _factored(),
        If("factored", tuple(factor)),
        *[stage_time(f"time{k}", _C[k]) for k in range(3)],
        *_guess(z, powers),
        combined(_T_INVERSE, z, w),
        _begin(),
        FixedPoint("going", (*_turn(problem, z, w, f), *_compared(m))),
        _unsolved(),
    ]
    controls = "h_old nonfinite_real nonfinite_complex going turns stalled change change_old exact newton".split()
    controls += "converged failed again sum renewed current slow h_factored factored theta accepted next".split()
    controls += ["jacobians", "factorizations"]
    lengths = _lengths(m) | on_the_way | dict.fromkeys((*powers, "error_vector", "size", "least"), m)
    lengths |= {"rtol": 1, "atol": m, "leap": 1, "evaluations": 1} | dict.fromkeys(controls, 1)
    zeros = Graph([], {f"{k}": 0.0 for k in range(m)})
    return Step(
        lengths,
        body,
        prepare=[Call(problem.rate, ("x", "t", "p"), ("rate",))],
        start=[identity(m), *[Call(zeros, (), (name,)) for name in (*powers, "size")], _nothing_kept()],
        kept=[combined(_POWERS, z, powers), copied("h", "h_old"), _keeping()],
        fixed=("jacobian", "real", "complex", "size", "least", "rtol", "atol", "leap", *powers, *on_the_way, *controls),
        failed="failed",
        error=_estimate(problem, z),
        estimate=4,
        dense=[combined(_POWERS, z, ("dense1", "dense2", "dense3"))],
    )


def _nothing_kept() -> Call:
    """Statements that forget Jacobian and factors of the step before."""
    return Call(Graph([], {"current": 0.0, "h_factored": 0.0}), (), ("current", "h_factored"))


def _renewed() -> Call:
    """Whether the Jacobian is evaluated: not if it is that of this state, or the last step converged fast by it.

    After a trial by that of another state it is, and without an error to choose steps by always.
    """
    names = ("current", "accepted", "slow", "h_factored")
    current, accepted, slow, before = inputs = cg.variables(names)
    fast = accepted * cg.equal(slow, 0.0) * cg.not_equal(before, 0.0)
    renewed = (1.0 - current) * (1.0 - fast)
    outputs = {"renewed": renewed, "current": cg.maximum(current, renewed)}
    return Call(Graph(inputs, outputs), names, tuple(outputs))


def _factored() -> Call:
    """Whether the matrices are made and factored: for another Jacobian, or a step of another length."""
    h, before, renewed = inputs = cg.variables("h before renewed")
    other = abs(h - before) > SAME_LENGTH * abs(h)
    return Call(Graph(inputs, {"y": cg.maximum(renewed, other)}), ("h", "h_factored", "renewed"), ("factored",))


def _keeping() -> Call:
    """Statements after an accepted step: whether the Jacobian serves the next, its factors, too, if hardly longer."""
    theta, h, wanted = inputs = cg.variables("theta h next")
    slow, same = theta > FAST, abs(h)
    alike = (1.0 - slow) * (wanted >= same) * (wanted <= LONGER_STEP * same)
    outputs: dict[str, Node | float] = {"slow": slow, "current": 0.0, "next": cg.where(alike, same, wanted)}
    return Call(Graph(inputs, outputs), ("theta", "h", "next"), tuple(outputs))


def _lengths(m: int) -> dict[str, int]:
    lengths = {"unit": m * m, "jacobian": m * m, "real": m * m, "complex": 4 * m * m, "pivots": m, "pivots2": 2 * m}
    lengths |= dict.fromkeys([f"{name}{k}" for name in "ZWF" for k in range(3)], m)
    lengths |= dict.fromkeys(("rate", "at", "right0"), m) | {"right12": 2 * m}
    return lengths | dict.fromkeys("time0 time1 time2".split(), 1)


def _sizes(problem: Problem) -> Call:
    """Call for the size of each component so far, and its rounding: of no less than 1e-6 of the largest of its kind."""
    m, nq = problem.size, problem.nq
    names = ["size", "x", "rate"]
    size, x, rate = ([cg.variable(f"{name}{k}") for k in range(m)] for name in names)
    h = cg.variable("h")
    largest = [cg.maximum(cg.maximum(a, abs(b)), abs(h * c)) for a, b, c in zip(size, x, rate, strict=True)]
    kinds = [range(nq), range(nq, m)] if problem.system is not None else [range(k, k + 1) for k in range(m)]
    scales: list[Node] = []
    for kind in kinds:
        most = reduce(cg.maximum, [largest[k] for k in kind], cg.constant(0.0))
        scales += [EPSILON * cg.maximum(largest[k], SMALL_COMPONENT * most) for k in kind]
    outputs = {f"{k}": node for k, node in enumerate([*largest, *scales])}
    return Call(Graph([*size, *x, *rate, h], outputs), (*names, "h"), ("size", "least"))


def _matrices(m: int) -> list[Statement]:
    """Statements that factor the real and the complex matrix of Newton's iteration."""
    unit, h, slope = cg.variables("unit h slope")
    real = Map(Graph([unit, h, slope], {"w": _REAL / h * unit - slope}), ("unit", "h", "jacobian"), ("real",))
    jacobian = [cg.variables([f"j{row}_{column}" for column in range(m)]) for row in range(m)]
    a, b = _COMPLEX.real / h, _COMPLEX.imag / h
    entries: list[Node | float] = []  # [[a - J, b], [-b, a - J]]
    for upper in (True, False):
        for k, row in enumerate(jacobian):
            same = [a - entry if column == k else -entry for column, entry in enumerate(row)]
            other: list[Node | float] = [0.0] * m
            other[k] = b if upper else -b
            entries += [*same, *other] if upper else [*other, *same]
    outputs = {f"{k}": entry for k, entry in enumerate(entries)}
    both = Graph([*(entry for row in jacobian for entry in row), h], outputs)
    both_factored = [Call(both, ("jacobian", "h"), ("complex",)), Factor("complex", "pivots2")]
    return [real, Factor("real", "pivots"), *both_factored]


def _guess(z: tuple[str, ...], powers: tuple[str, ...]) -> list[Statement]:
    """Z from the polynomial of the step before, carried on."""
    h, old, *coefficients = inputs = cg.variables(["h", "h_old", *powers])
    body: list[Statement] = []
    for k, c in enumerate(_C):
        ratio = cg.where(old, h / old, 0.0)
        s = 1.0 + c * ratio
        ahead = [power * (s ** float(j + 1) - 1.0) for j, power in enumerate(coefficients)]
        graph = Graph(inputs, {"z": ahead[0] + ahead[1] + ahead[2]})
        body.append(Map(graph, ("h", "h_old", *powers), (z[k],)))
    return body


def _begin() -> Call:
    """Newton's iteration starts; it ends where a change is small beside the tolerance of the step.

    Without a tolerance, where the step cannot be halved: beside rounding, after as many turns as it takes.
    """
    rtol = cg.variable("rtol")
    newton = cg.maximum(10.0 * EPSILON / rtol, cg.minimum(0.03, cg.sqrt(rtol)))
    outputs: dict[str, Node | float] = {
        "going": 1.0,
        "turns": 0.0,
        "stalled": 0.0,
        "change_old": math.inf,
        "converged": 0.0,
        "exact": cg.equal(rtol, 0.0),
        "newton": cg.where(rtol, newton, 10.0),
    }
    return Call(Graph([rtol], outputs), ("rtol",), tuple(outputs))


def _turn(problem: Problem, z: tuple[str, ...], w: tuple[str, ...], f: tuple[str, ...]) -> list[Statement]:
    """W += (systems)^-1 (T^-1 F(Z) - eigenvalues / h * W)."""
    m = problem.size
    body: list[Statement] = []
    for k in range(3):
        body += [added("x", z[k], "at"), Call(problem.rate, ("at", f"time{k}", "p"), (f[k],))]
    h, *nodes = inputs = cg.variables(["h", *w, *f])
    ws, fs = nodes[:3], nodes[3:]
    parts = [weighted(fs, row) for row in _T_INVERSE]
    a, b = _COMPLEX.real / h, _COMPLEX.imag / h
    outputs: dict[str, Node | float] = {
        "0": parts[0] - _REAL / h * ws[0],
        "1": parts[1] - (a * ws[1] + b * ws[2]),
        "2": parts[2] - (a * ws[2] - b * ws[1]),
    }
    rights = Map(Graph(inputs, outputs), ("h", *w, *f), ("right0", "F1", "F2"))
    joined = end_to_end(2 * m, ("F1", "F2"), ("right12",))
    parted = end_to_end(2 * m, ("right12",), ("F1", "F2"))
    body += [rights, Solve("real", "pivots", "right0"), joined, Solve("complex", "pivots2", "right12"), parted]
    body += [added(name, change, name) for name, change in zip(w, CHANGES, strict=True)]
    return [*body, combined(_T, w, z), added("x", z[2], "x_new")]


def _compared(m: int) -> list[Statement]:
    """The change of a turn beside the tolerance of the step, or rounding, and what follows from it."""
    names = (*SCALE, "least")
    *sizes, least = inputs = cg.variables(names)
    changes = cg.variables("d0 d1 d2")
    size = cg.where(sizes[SCALE.index("rtol")], scale(*sizes), least)
    squares = [cg.where(change, (change / size) * (change / size), 0.0) for change in changes]
    graph = Graph([*inputs, *changes], {"y": squares[0] + squares[1] + squares[2]})
    return [Sum(graph, (*names, *CHANGES), "change"), _judged(3 * m)]


def _judged(numbers: int) -> Call:
    """Whether Newton's iteration goes on, and whether it has converged.

    One that will not come to the tolerance in time has not; beside rounding, one that comes no nearer has.
    """
    names = ("change", "change_old", "turns", "stalled", "exact", "newton", "evaluations")
    total, old, turns, stalled, exact, newton, done = inputs = cg.variables(names)
    change = cg.sqrt(total / numbers)
    rate = change / old  # 0 in the first turn
    left = rate / (1.0 - rate) * change
    hopeful = (rate < 1.0) * (rate ** (TURNS - 1.0 - turns) / (1.0 - rate) * change <= newton)
    first = cg.equal(turns, 0.0)
    settled = cg.maximum(cg.equal(change, 0.0), (1.0 - first) * (rate < 1.0) * (left < newton))
    finite = change < math.inf
    stalls = stalled + (1.0 - (rate < 1.0))
    hope = cg.where(exact, stalls < STALLS, cg.maximum(first, hopeful))
    going = finite * (1.0 - settled) * hope * (turns + 1.0 < cg.where(exact, MOST_TURNS, TURNS))
    outputs = {
        "going": going,
        "converged": cg.maximum(settled, exact * finite * (stalls >= STALLS)),
        "turns": turns + 1.0,
        "stalled": stalls,
        "change_old": change,
        "theta": rate,
        "evaluations": done + 3.0,
    }
    return Call(Graph(inputs, outputs), names, tuple(outputs))


def _unsolved() -> Call:
    """Register `failed`, of a step that cannot be halved."""
    failed, converged = cg.variables("failed converged")
    graph = Graph([failed, converged], {"failed": failed + (1.0 - converged)})
    return Call(graph, ("failed", "converged"), ("failed",))


def _estimate(problem: Problem, z: tuple[str, ...]) -> list[Statement]:
    """The error as the real system filters it; filtered twice when the first says no (section IV.8, eq. 8.19 and 8.20).

    Where Newton's iteration did not converge, an error that halves the step.
    """
    m = problem.size
    rate, h, *nodes = inputs = cg.variables(["rate", "h", *z])
    right = Map(Graph(inputs, {"e": rate + weighted(nodes, _ERROR) / h}), ("rate", "h", *z), ("error_vector",))
    once: list[Statement] = [right, Solve("real", "pivots", "error_vector"), *measured("error_vector", m)]
    error, before, old, converged = cg.variables("error accepted h_old converged")
    doubt = Graph([error, before, old], {"again": (error > 1.0) * cg.maximum(1.0 - before, cg.equal(old, 0.0))})
    twice = (
        added("x", "error_vector", "at"),
        Call(problem.rate, ("at", "t", "p"), ("F0",)),
        Map(Graph(inputs, {"e": rate + weighted(nodes, _ERROR) / h}), ("F0", "h", *z), ("error_vector",)),
        Solve("real", "pivots", "error_vector"),
        *measured("error_vector", m),
    )
    none, none2 = cg.variables("nonfinite_real nonfinite_complex")
    halved = Graph([error, converged, none, none2], {"error": cg.where(converged, error + none + none2, HALVES)})
    return [
        nonfinite("nonfinite_real", "real"),
        nonfinite("nonfinite_complex", "complex"),
        *once,
        Call(doubt, ("error", "accepted", "h_old"), ("again",)),
        If("again", twice),
        Call(halved, ("error", "converged", "nonfinite_real", "nonfinite_complex"), ("error",)),
    ]
