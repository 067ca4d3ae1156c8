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
from collections.abc import Sequence
from fractions import Fraction

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Call, FixedPoint, Map, Statement, Sum

from ..systems.arguments import TIME
from .composition import Composition
from .elementwise import SAME, compensated, function, weighted
from .explicit import stage_time
from .momentum_graphs import Mechanics, mechanics
from .partitioned_tableau import MIDPOINT, SYMPLECTIC_EULER, VERLET, Partitioned, Row, over
from .problem import Problem, reaches
from .step import Step
from .step_control import count

TURNS = 60.0  # of the iteration for the stages, at most
ENOUGH = 2.0**-53  # a change below this, relative, is rounding
LOOSE = 1e-9  # one above this, when the turns are over, is no convergence: the step is too long
REPEATS = 8  # Newton steps for the velocity of a momentum that is not linear in it
ONCE = Composition(2, (1.0,))


def composed_step(composition: Composition, problem: Problem) -> Step:
    """One step, of steps of `verlet` where it is explicit, else of `midpoint`."""
    explicit = problem.canonical and _separable(problem)
    return partitioned_step(VERLET if explicit else MIDPOINT, problem, composition)


def partitioned_step(method: Partitioned, problem: Problem, composition: Composition = ONCE) -> Step:
    """One step of coordinates and momenta; where there are none, of the state by a method of Gauss's."""
    if problem.canonical:
        return (_of_phase if problem.momenta else _of_momenta)(method, problem, composition)
    return _of_states(method, problem, composition)


def _separable(problem: Problem) -> bool:
    """Whether the rates of the coordinates depend on momenta alone, and the rates of these on coordinates and time."""
    if not problem.momenta:
        return mechanics(problem).separable
    states, rates = cg.variables(list(problem.states)), list(problem.rate.outputs.values())
    nq = problem.nq
    return not (reaches(rates[:nq], [*states[:nq], cg.variable(TIME)]) or reaches(rates[nq:], states[nq:]))


def _of_momenta(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    graphs, n = mechanics(problem), problem.nq
    stages = range(len(method.w))
    lengths = {"q": n, "v": n, "momentum": n, "q_rounding": n, "momentum_rounding": n}
    lengths |= {f"{name}{i}": n for name in ("Q", "V", "P", "F", "W") for i in stages}
    read = Call(graphs.momentum, ("x", "t", "p"), ("momentum",))
    start = [_copied(problem.size, ("x",), ("q", "v")), read]
    if graphs.separable and method in (SYMPLECTIC_EULER, VERLET):
        body = _explicit(method, graphs)
    else:
        turn: list[Statement] = []
        for i in stages:
            turn += [_stage(method.a[i], "q", "V", f"Q{i}"), _force(graphs, f"Q{i}", f"V{i}", f"time{i}", f"F{i}")]
        for i in stages:
            turn.append(_stage(method.b[i], "momentum", "F", f"P{i}"))
            turn.append(_velocity(graphs, f"Q{i}", f"V{i}", f"P{i}", f"time{i}", f"W{i}"))
        body = _iterated(method, turn)
        body += [_added("q", "q_rounding", "V", method.w), _added("momentum", "momentum_rounding", "F", method.w)]
        body += [stage_time("later", 1.0), *_settled(graphs)]
    body = [*_in_turn(composition, body), _copied(problem.size, ("q", "v"), ("x_new",))]
    return _step(method, lengths, [*start, *_guess_at_rest(method, "v")], body)


def _of_phase(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    """States q and p: both rates come of one graph, and stages are iterated on them."""
    n, stages = problem.nq, range(len(method.w))
    lengths = {f"{name}{i}": n for name in ("Q", "P", "V", "F", "W") for i in stages}
    lengths |= dict.fromkeys(("q", "momentum", "q_rounding", "momentum_rounding"), n)
    both = ("V0", "F0")
    start: list[Statement] = [
        _copied(problem.size, ("x",), ("q", "momentum")),
        Call(problem.rate, ("q", "momentum", "t", "p"), both),
        *_guess_at_rest(method, "V0"),
        *[Map(SAME, ("F0",), (f"F{i}",)) for i in stages],
    ]
    body: list[Statement]
    if method in (SYMPLECTIC_EULER, VERLET) and _separable(problem):
        half = method is VERLET
        kick = _stage(over(2, 1 if half else 2), "momentum", "F", "momentum")
        body = [
            Call(problem.rate, ("q", "momentum", "t", "p"), both),
            kick,
            Call(problem.rate, ("q", "momentum", "t", "p"), both),
            _added("q", "q_rounding", "V", (Fraction(1),)),
            stage_time("later", 1.0),
        ]
        if half:
            body += [Call(problem.rate, ("q", "momentum", "later", "p"), both), kick]
    else:
        turn: list[Statement] = [count(len(stages))]
        for velocity in ("V", "W"):  # twice, since an error of V comes back to V by F
            for i in stages:
                turn.append(_stage(method.a[i], "q", "V", f"Q{i}"))
                turn.append(_stage(method.b[i], "momentum", "F", f"P{i}"))
            turn += [
                Call(problem.rate, (f"Q{i}", f"P{i}", f"time{i}", "p"), (f"{velocity}{i}", f"F{i}")) for i in stages
            ]
        body = _iterated(method, turn)
        body += [_added("q", "q_rounding", "V", method.w), _added("momentum", "momentum_rounding", "F", method.w)]
    body = [*_in_turn(composition, body), _copied(problem.size, ("q", "momentum"), ("x_new",))]
    return _step(method, lengths, start, body)


def _of_states(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    if method.a is not method.b:
        system = problem.system
        if system is None:
            raise ValueError("this method advances coordinates and momenta in turn; a system of first order has none")
        if len(system.constraints):
            raise ValueError(
                "this method advances coordinates and their momenta in turn, and constraint "
                f"{system.constraints.names[0]!r} holds both: take 'midpoint', 'gauss4' or 'dop853'"
            )
        pairs = zip(system.velocities, system.qd, strict=True)
        other = next(name for name, velocity in pairs if velocity not in system.q_dot)
        raise ValueError(
            "this method advances coordinates and their momenta in turn, and velocity "
            f"{other!r} is the rate of no coordinate: take 'midpoint', 'gauss4' or 'dop853'"
        )
    m, stages = problem.size, range(len(method.w))
    lengths = {"x_rounding": m} | {f"{name}{i}": m for name in ("Q", "V", "W") for i in stages}
    turn: list[Statement] = []
    for i in stages:
        turn.append(_stage(method.a[i], "x_new", "V", f"Q{i}"))
        turn.append(Call(problem.rate, (f"Q{i}", f"time{i}", "p"), (f"W{i}",)))
    body = [*_iterated(method, turn), _added("x_new", "x_rounding", "V", method.w)]
    rate = Call(problem.rate, ("x", "t", "p"), ("W0",))
    body = [Map(SAME, ("x",), ("x_new",)), *_in_turn(composition, body)]
    return _step(method, lengths, [rate, *_guess_at_rest(method, "W0")], body)


def _step(method: Partitioned, lengths: dict[str, int], start: list[Statement], body: list[Statement]) -> Step:
    names = "singular failed failures whole begin going turns change speed change_old later"
    single = dict.fromkeys(names.split(), 1)
    single |= {f"{name}{i}": 1 for name in ("time", "change", "speed") for i in range(len(method.w))}
    fixed = [name for name in lengths if name.endswith("rounding")]
    fixed += [name for name in single if not name.startswith(("time", "whole", "begin", "later"))]
    return Step({**lengths, **single}, body, start=start, fixed=tuple(fixed), failed="failures")


def _in_turn(composition: Composition, body: list[Statement]) -> list[Statement]:
    """The body, a step of h from t, once for every step of a composition; a step that failed is counted."""
    whole, begin, failures = cg.variables("whole begin failures")
    counted = Call(
        function("failed failures", sum=cg.variable("failed") + failures), ("failed", "failures"), ("failures",)
    )
    if composition is ONCE:
        return [*body, counted]
    result: list[Statement] = [Map(SAME, ("h",), ("whole",)), Map(SAME, ("t",), ("begin",))]
    done = 0.0
    for step in composition.steps:
        here = Graph([whole, begin], {"h": step * whole, "t": begin + done * whole})
        result += [Call(here, ("whole", "begin"), ("h", "t")), *body, counted]
        done += step
    return [*result, Map(SAME, ("whole",), ("h",))]


def _stage(weights: Row, base: str, slope: str, target: str) -> Map:
    """target = base + h * (sum of weight * slope)."""
    used = [k for k, weight in enumerate(weights) if weight]
    x, h, *slopes = cg.variables(["x", "h", *(f"s{k}" for k in used)])
    change, rest = _change(h, slopes, [weights[k] for k in used])
    graph = Graph([x, h, *slopes], {"y": x + (change if rest is None else change + rest)})
    return Map(graph, (base, "h", *[f"{slope}{k}" for k in used]), (target,))


def _change(h: Node, slopes: Sequence[Node], weights: Sequence[Fraction]) -> tuple[Node, Node | None]:
    """h * (sum of weight * slope), by the weights as float64 holds them, and by what it leaves of them."""
    held = [float(weight) for weight in weights]
    left = [float(weight - Fraction(number)) for weight, number in zip(weights, held, strict=True)]
    return h * weighted(slopes, held), h * weighted(slopes, left) if any(left) else None


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
        measured.append(Map(SAME, (f"W{i}",), (f"V{i}",)))
    body.append(FixedPoint("going", (*turn, *measured, _judged(len(method.w)))))
    return body


def _judged(stages: int) -> Call:
    """Whether to go on: not when V has settled, no longer comes nearer, or is no number."""
    changes, speeds = ([f"{name}{i}" for i in range(stages)] for name in ("change", "speed"))
    change, speed = (sum(cg.variables(names)[1:], cg.variable(names[0])) for names in (changes, speeds))
    turns, old, done = cg.variables("turns change_old evaluations")
    nearer = cg.maximum(change < old, turns < 2.0)
    going = (change > ENOUGH * ENOUGH * speed) * nearer * (turns + 1.0 < TURNS)
    settled = change <= LOOSE * LOOSE * speed + 2.0**-1000
    outputs = {
        "going": going,
        "turns": turns + 1.0,
        "change_old": change,
        "failed": (1.0 - going) * (1.0 - settled),
        "evaluations": done + float(stages),
    }
    inputs = (*changes, *speeds, "turns", "change_old", "evaluations")
    return Call(Graph(cg.variables(inputs), outputs), inputs, tuple(outputs))


def _guess_at_rest(method: Partitioned, velocity: str) -> list[Statement]:
    return [Map(SAME, (velocity,), (f"V{i}",)) for i in range(len(method.w))]


def _added(base: str, rounding: str, slope: str, weights: Row) -> Map:
    """base += h * (sum of weight * slope), with what rounding took off kept for the next step."""
    x, before, h, *slopes = cg.variables(["x", "rounding", "h", *(f"s{k}" for k in range(len(weights)))])
    change, rest = _change(h, slopes, weights)
    total, after = compensated(x, change + (before if rest is None else before + rest))
    graph = Graph([x, before, h, *slopes], {"x": total, "rounding": after})
    return Map(graph, (base, rounding, "h", *[f"{slope}{k}" for k in range(len(weights))]), (base, rounding))


def _settled(graphs: Mechanics) -> list[Statement]:
    """v, the velocity that belongs to the momenta at the end of the step."""
    once = _velocity(graphs, "q", "v", "momentum", "later", "v")
    return [once] if graphs.quadratic else [once] * REPEATS


def _explicit(method: Partitioned, graphs: Mechanics) -> list[Statement]:
    """Kinetic energy of the velocities alone with a constant mass matrix, forces of the coordinates: no iteration."""
    half = method is VERLET
    kick = _stage(over(2, 1 if half else 2), "momentum", "F", "momentum")
    body: list[Statement] = [
        _force(graphs, "q", "v", "t", "F0"),
        kick,
        _velocity(graphs, "q", "v", "momentum", "t", "v"),
        _added("q", "q_rounding", "V", (Fraction(1),)),
        stage_time("later", 1.0),
    ]
    body.insert(3, Map(SAME, ("v",), ("V0",)))
    if half:
        body += [_force(graphs, "q", "v", "later", "F0"), kick, _velocity(graphs, "q", "v", "momentum", "later", "v")]
    return [*body, count(2 if half else 1)]


def _copied(count: int, sources: tuple[str, ...], targets: tuple[str, ...]) -> Call:
    """The numbers of some registers into others."""
    nodes = cg.variables([f"c{k}" for k in range(count)])
    return Call(Graph(nodes, {f"c{k}": node for k, node in enumerate(nodes)}), sources, targets)
