"""Symplectic methods: partitioned Runge-Kutta methods on the coordinates q and the momenta p = dL/dqd.

Stages Q_i = q + h sum_j a_ij V_j and P_i = p + h sum_j b_ij F(Q_j, V_j), with the velocity V_i that belongs to P_i at
Q_i; a step adds h sum_i w_i V_i to q and h sum_i w_i F_i to p (Hairer, Lubich and Wanner, sections II.2 and VI.4). The
stages are solved for by iterating on the velocities until they no longer come nearer, each turn a Newton step of
V_i -> P_i(V_i), so that nothing has to be explicit, separable or quadratic. Sums over many steps are compensated, and
numbers of the method that float64 does not hold are two, the second what rounding took off the first: a method is only
symplectic as exactly as w_i b_ij + w_j a_ji = w_i w_j, and what is missing adds up to a drift of the energy (Hairer,
McLachlan and Razakarivony, BIT Numerical Mathematics 2008).

Quasi-velocities have no such momenta, and constraints hold them. Methods of Gauss, and compositions of `midpoint`, step
the state (q, qd) there, as that of a system of first order. They keep every quadratic invariant, as |q| of a
quaternion, and the energy and the size of the momentum of a free rotor; and being symmetric, they leave the energy of
reversible motions without drift.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, FixedPoint, Map, Statement, Sum, added, copied

from ..systems.arguments import TIME
from .elementwise import compensated, end_to_end, function, stage_time, weighted
from .momenta import Mechanics, mechanics
from .problem import Problem, reaches
from .step import Step
from .step_control import count
from .symplectic_tableaus import MIDPOINT, SYMPLECTIC_EULER, VERLET, Composition, Fractions, Partitioned, over

TURNS = 60.0  # of the iteration for the stages, at most
CONVERGED = 2.0**-53  # a change below this, relative, is rounding
DIVERGED = 1e-9  # one above this, when the turns are over, is no convergence: the step is too long
REPEATS = 8  # Newton steps for the velocity of a momentum that is not linear in it
ONCE = Composition(2, (1.0,))


def composed_step(composition: Composition, problem: Problem) -> Step:
    """One step, of steps of `verlet` where it is explicit, else of `midpoint`."""
    explicit = problem.canonical and _separable(problem)
    return partitioned_step(VERLET if explicit else MIDPOINT, problem, composition)


def partitioned_step(method: Partitioned, problem: Problem, composition: Composition = ONCE) -> Step:
    """One step of coordinates and momenta; where there are none, of the state by a method of Gauss's."""
    if problem.canonical and not problem.momenta:
        return _of_momenta(method, problem, composition)
    if not problem.canonical and method.a is not method.b:
        raise ValueError(f"this method advances coordinates and {_lacking_momenta(problem)}")
    return _of_rates(method, problem, composition)


def _lacking_momenta(problem: Problem) -> str:
    """Reason why coordinates and momenta cannot be advanced in turn; empty if they can."""
    system = problem.system
    if system is None:
        return "momenta in turn; a system of first order has none"
    if len(system.constraints):
        holding = f"constraint {system.constraints.names[0]!r} holds both"
        return f"their momenta in turn, and {holding}: take 'midpoint', 'gauss4' or 'dop853'"
    pairs = zip(system.velocities, system.qd, strict=True)
    other = next(name for name, velocity in pairs if velocity not in system.q_dot)
    no_rate = f"velocity {other!r} is the rate of no coordinate"
    return f"their momenta in turn, and {no_rate}: take 'midpoint', 'gauss4' or 'dop853'"


def _separable(problem: Problem) -> bool:
    """Whether the rates of the coordinates depend on momenta alone, and the rates of these on coordinates and time."""
    if not problem.momenta:
        return mechanics(problem).separable
    states, rates = cg.variables(list(problem.states)), list(problem.rate.outputs.values())
    nq = problem.nq
    return not (reaches(rates[:nq], [*states[:nq], cg.variable(TIME)]) or reaches(rates[nq:], states[nq:]))


def _of_momenta(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    """States q and qd: momenta are read at the start, and the velocity that belongs to them is solved for."""
    graphs, n = mechanics(problem), problem.nq
    stages = range(len(method.w))
    lengths = dict.fromkeys(("q", "v", "momentum", "q_rounding", "momentum_rounding"), n)
    lengths |= {f"{name}{i}": n for name in "QVPFW" for i in stages}
    read = Call(graphs.momentum, ("x", "t", "p"), ("momentum",))
    start = [end_to_end(problem.size, ("x",), ("q", "v")), read, *[copied("v", f"V{i}") for i in stages]]
    if graphs.separable and method in (SYMPLECTIC_EULER, VERLET):
        body = _explicit(
            method,
            lambda t: [_force(graphs, "q", "v", t, "F0")],
            lambda t: [_velocity(graphs, "q", "v", "momentum", t, "v")],
            after=[copied("v", "V0")],
        )
        body += [_velocity(graphs, "q", "v", "momentum", "later", "v"), count(2)] if method is VERLET else [count(1)]
    else:
        turn: list[Statement] = []
        for i in stages:
            turn += [_stage(method.a[i], "q", "V", f"Q{i}"), _force(graphs, f"Q{i}", f"V{i}", f"time{i}", f"F{i}")]
        for i in stages:
            turn.append(_stage(method.b[i], "momentum", "F", f"P{i}"))
            turn.append(_velocity(graphs, f"Q{i}", f"V{i}", f"P{i}", f"time{i}", f"W{i}"))
        body = _iterated(method, turn)
        body += [_added("q", "V", method.w), _added("momentum", "F", method.w), stage_time("later", 1.0)]
        settled = _velocity(graphs, "q", "v", "momentum", "later", "v")
        body += [settled] * (1 if graphs.quadratic else REPEATS)
    body = [*_in_turn(composition, body), end_to_end(problem.size, ("q", "v"), ("x_new",))]
    return _step(method, lengths, start, body)


def _of_rates(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    """States whose rates come of one graph: q and p, of stages Q and P, or any state, of stages Q alone."""
    stages = range(len(method.w))
    parts = [("q", "Q", "V", method.a), ("momentum", "P", "F", method.b)][: 2 if problem.momenta else 1]
    bases, slopes = tuple([part[0] for part in parts]), [part[2] for part in parts]
    m, first = problem.size, problem.nq if problem.momenta else problem.size
    lengths = {f"W{i}": first for i in stages}
    for (base, stage, slope, _), length in zip(parts, (first, m - first), strict=False):
        names = base, f"{base}_rounding", *[f"{name}{i}" for name in (stage, slope) for i in stages]
        lengths |= dict.fromkeys(names, length)

    def rates(at: Sequence[str], t: str, velocity: str, i: int = 0) -> Call:
        return Call(problem.rate, (*at, t, "p"), tuple([f"{name}{i}" for name in (velocity, *slopes[1:])]))

    start = [rates("x", "t", "V"), *[copied(f"{slope}0", f"{slope}{i}") for slope in slopes for i in stages[1:]]]
    body: list[Statement]
    if method in (SYMPLECTIC_EULER, VERLET) and _separable(problem):
        body = _explicit(method, lambda t: [rates(bases, t, "V")], lambda t: [rates(bases, t, "V")])
    else:
        turn: list[Statement] = [count(len(stages))] if problem.momenta else []
        for velocity in ("V", "W") if problem.momenta else "W":  # twice, since an error of V comes back to V by F
            turn += [_stage(a[i], base, slope, f"{stage}{i}") for i in stages for base, stage, slope, a in parts]
            turn += [rates([f"{part[1]}{i}" for part in parts], f"time{i}", velocity, i) for i in stages]
        body = [*_iterated(method, turn), *[_added(base, slope, method.w) for base, _, slope, _ in parts]]
    body = [end_to_end(m, ("x",), bases), *_in_turn(composition, body), end_to_end(m, bases, ("x_new",))]
    return _step(method, lengths, start, body)


def _step(method: Partitioned, lengths: dict[str, int], start: Sequence[Statement], body: list[Statement]) -> Step:
    numbers = [f"{name}{i}" for name in ("change", "speed") for i in range(len(method.w))]
    numbers += "singular failed failures going turns change speed change_old".split()
    times = ["later", "whole_t", "whole_h", *[f"time{i}" for i in range(len(method.w))]]
    fixed = [*[name for name in lengths if name.endswith("rounding")], *numbers]
    lengths = lengths | dict.fromkeys([*numbers, *times], 1)
    return Step(lengths, body, start=start, fixed=tuple(fixed), failed="failures")


def _in_turn(composition: Composition, body: list[Statement]) -> list[Statement]:
    """The body, a step of h from t, once for every step of a composition; a step that failed is counted."""
    counted = added("failures", "failed", "failures")
    if composition is ONCE:
        return [*body, counted]
    h, t = cg.variables("whole_h whole_t")
    result: list[Statement] = [copied("h", "whole_h"), copied("t", "whole_t")]
    done = 0.0
    for step in composition.steps:
        here = Graph([h, t], {"h": step * h, "t": t + done * h})
        result += [Call(here, ("whole_h", "whole_t"), ("h", "t")), *body, counted]
        done += step
    return [*result, copied("whole_h", "h")]


def _stage(weights: Fractions, base: str, slope: str, target: str) -> Map:
    """target = base + h * (sum of weight * slope)."""
    used = [k for k, weight in enumerate(weights) if weight]
    x, h, *slopes = cg.variables(["x", "h", *(f"s{k}" for k in used)])
    change, rest = _change(h, slopes, [weights[k] for k in used])
    graph = Graph([x, h, *slopes], {"y": x + (change if rest is None else change + rest)})
    return Map(graph, (base, "h", *[f"{slope}{k}" for k in used]), (target,))


def _change(h: Node, slopes: Sequence[Node], weights: Sequence[Fraction]) -> tuple[Node, Node | None]:
    """h * (sum of weight * slope), by the weights as float64 holds them, and by what it leaves of them."""
    first = [float(weight) for weight in weights]
    left = [float(weight - Fraction(number)) for weight, number in zip(weights, first, strict=True)]
    return h * weighted(slopes, first), h * weighted(slopes, left) if any(left) else None


def _force(graphs: Mechanics, q: str, v: str, t: str, target: str) -> Call:
    return Call(graphs.force, (q, v, t, "p"), (target,))


def _velocity(graphs: Mechanics, q: str, v: str, momentum: str, t: str, target: str) -> Call:
    return Call(graphs.velocity, (q, v, momentum, t, "p", "singular"), (target, "singular"))


def _iterated(method: Partitioned, turn: list[Statement]) -> list[Statement]:
    """Times and a first guess of the stages, and turns from V to W until W = V to rounding."""
    stages = range(len(method.w))
    body: list[Statement] = [stage_time(f"time{i}", float(method.c[i])) for i in stages]
    begin = Graph([], {"going": 1.0, "turns": 0.0, "change_old": math.inf})
    body.append(Call(begin, (), ("going", "turns", "change_old")))
    difference = function("w v", change=(cg.variable("w") - cg.variable("v")) ** 2.0)
    square = function("w", speed=cg.variable("w") * cg.variable("w"))
    measured: list[Statement] = []
    for i in stages:
        measured += [Sum(difference, (f"W{i}", f"V{i}"), f"change{i}"), Sum(square, (f"W{i}",), f"speed{i}")]
        measured.append(copied(f"W{i}", f"V{i}"))
    body.append(FixedPoint("going", (*turn, *measured, _judged(len(method.w)))))
    return body


def _judged(stages: int) -> Call:
    """Whether to go on: not when V has settled, no longer comes nearer, or is no number."""
    changes, speeds = ([f"{name}{i}" for i in range(stages)] for name in ("change", "speed"))
    change, speed = (sum(cg.variables(names)[1:], cg.variable(names[0])) for names in (changes, speeds))
    turns, old, done = cg.variables("turns change_old evaluations")
    nearer = cg.maximum(change < old, turns < 2.0)
    going = (change > CONVERGED * CONVERGED * speed) * nearer * (turns + 1.0 < TURNS)
    settled = change <= DIVERGED * DIVERGED * speed + 2.0**-1000
    outputs = {
        "going": going,
        "turns": turns + 1.0,
        "change_old": change,
        "failed": (1.0 - going) * (1.0 - settled),
        "evaluations": done + float(stages),
    }
    inputs = (*changes, *speeds, "turns", "change_old", "evaluations")
    return Call(Graph(cg.variables(inputs), outputs), inputs, tuple(outputs))


def _added(base: str, slope: str, weights: Fractions) -> Map:
    """base += h * (sum of weight * slope), with what rounding took off kept for the next step."""
    x, before, h, *slopes = cg.variables(["x", "rounding", "h", *(f"s{k}" for k in range(len(weights)))])
    change, rest = _change(h, slopes, weights)
    total, after = compensated(x, change + (before if rest is None else before + rest))
    graph, rounding = Graph([x, before, h, *slopes], {"x": total, "rounding": after}), f"{base}_rounding"
    return Map(graph, (base, rounding, "h", *[f"{slope}{k}" for k in range(len(weights))]), (base, rounding))


def _explicit(
    method: Partitioned,
    force: Callable[[str], list[Statement]],
    velocity: Callable[[str], list[Statement]],
    after: Sequence[Statement] = (),
) -> list[Statement]:
    """Kinetic energy of the velocities alone with a constant mass matrix, forces of the coordinates: no iteration.

    force, velocity: registers F0 and V0 at q and the momentum, at a time; V0 needs what is `after` besides.
    """
    half = method is VERLET
    kick = _stage(over(2, 1 if half else 2), "momentum", "F", "momentum")
    body = [*force("t"), kick, *velocity("t"), *after, _added("q", "V", (Fraction(1),)), stage_time("later", 1.0)]
    return [*body, *force("later"), kick] if half else body
