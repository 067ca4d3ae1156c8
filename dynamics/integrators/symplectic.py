"""Symplectic methods: partitioned Runge-Kutta methods on the coordinates q and the momenta p = dL/dqd.

Stages Q_i = q + h sum_j a_ij V_j and P_i = p + h sum_j b_ij F(Q_j, V_j), with the velocity V_i that belongs to P_i at
Q_i; a step adds h sum_i w_i V_i to q and h sum_i w_i F_i to p (Hairer, Lubich and Wanner, sections II.2 and VI.4). The
stages are solved for by iterating on the velocities until they no longer come nearer, each turn a Newton step of
V_i -> P_i(V_i). Sums over many steps are compensated, and numbers of the method are as exact as two float64, since what
w_i b_ij + w_j a_ji = w_i w_j misses is a drift of the energy (Hairer, McLachlan and Razakarivony, BIT 2008). Where
there are no such momenta, methods of Gauss step the state (q, qd), as that of a system of first order.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Sequence
from fractions import Fraction
from functools import reduce
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import kept_by_first
from cgraph.extend import (
    Builder,
    Call,
    FixedPoint,
    Map,
    SingularError,
    Statement,
    added,
    building,
    copied,
    cotangents,
    solve_nodes,
)

from ..equations.mass_matrix.singular_mass_matrix import SingularMassMatrixError
from ..systems.arguments import TIME, new_variables
from ..systems.kinematics import numbered_graph
from .problem import Problem, reaches
from .rate_in_modes import in_modes
from .step import Step, Values, advanced, call, count, numbered, stage_time, summed, total
from .tableau import HALF, MIDPOINT, SYMPLECTIC_EULER, VERLET, Composition, Fractions, Partitioned

TURNS = 60.0  # of the iteration for the stages, at most
CONVERGED = 2.0**-53  # a change below this, relative, is rounding
DIVERGED = 1e-9  # one above this, when the turns are over, is no convergence: the step is too long
REPEATS = 8  # Newton steps for the velocity of a momentum that is not linear in it
ONCE = Composition(2, (1.0,))
NO_MOMENTA = (
    "this method advances coordinates and their momenta dL/dqd in turn, which a system of first order, with "
    "constraints or with quasi-velocities does not have: take 'midpoint', 'gauss4' or 'dop853'"
)


class Mechanics(NamedTuple):
    """A mechanical system in q and p = dL/dqd. Inputs of the graphs: those named here, then t, parameters."""

    momentum: Graph  # (q, qd) -> p
    force: Graph  # (q, qd) -> p_dot = dL/dq + tau + forces - damping qd
    velocity: Graph  # (q, qd, p) -> qd, nearer to that which belongs to p: a step of Newton, exact for quadratic K
    quadratic: bool  # the momenta are linear in the velocities: M does not depend on them
    separable: bool  # p = M qd with a constant M, and the forces do not depend on the velocities


@kept_by_first
def mechanics(problem: Problem) -> Mechanics:
    """The graphs of momenta of a problem. Raises ValueError or SingularMassMatrixError where they are none."""
    system = problem.system
    if system is None or not problem.canonical:
        raise ValueError(NO_MOMENTA)
    build, n, p = Builder(), system.n, new_variables("p", system.n, system.parameters)
    bars = cotangents({system.lagrangian: cg.constant(1.0)}, [*system.q, *system.qd], build)
    slopes, momenta = bars[:n], bars[n:]
    braking = system.braking(build)
    with building(build):
        parts = zip(slopes, system.tau, system.forces, braking, strict=True)
        force = [slope + tau + applied - brake for slope, tau, applied, brake in parts]
        missing = [wanted - here for wanted, here in zip(p, momenta, strict=True)]
    try:
        steps = solve_nodes(system.lagrangian, system.qd, missing, build)
    except SingularError as error:
        raise SingularMassMatrixError(
            f"the mass matrix is singular: coordinate {system.coordinates[error.index]!r} has no inertia, or none that "
            "others do not share, and a method that steps momenta needs it"
        ) from None
    with building(build):
        velocity = [qd + step for qd, step in zip(system.qd, steps, strict=True)]

    def graph(inputs: list[Node], outputs: list[Node]) -> Graph:
        whole = numbered_graph([*inputs, *system.tau, *system.extra_inputs], outputs)
        return in_modes(problem, problem.bind([str(node.name) for node in inputs], whole))

    state = [*system.q, *system.qd]
    momentum, rate = graph(state, momenta), graph(state, force)
    mass_matrix = [node for row in system.mass_matrix(system.lagrangian) for node in row]
    quadratic = not reaches(mass_matrix, system.qd)
    free = not reaches(rate.outputs.values(), system.qd)
    constant = not reaches([*mass_matrix, *momentum.outputs.values()], [*system.q, system.t])
    return Mechanics(momentum, rate, graph([*state, *p], velocity), quadratic, free and constant and quadratic)


def composed_step(composition: Composition, problem: Problem) -> Step:
    """One step, of steps of `verlet` where it is explicit, else of `midpoint`."""
    explicit = problem.canonical and not problem.slides and _separable(problem)
    return partitioned_step(VERLET if explicit else MIDPOINT, problem, composition)


def partitioned_step(method: Partitioned, problem: Problem, composition: Composition = ONCE) -> Step:
    """One step of coordinates and momenta; where there are none, of the state by a method of Gauss's."""
    if problem.slides and method.a is not method.b:
        method = MIDPOINT  # momenta are not free in a slide
    elif problem.canonical and not problem.momenta and not problem.slides:
        return _of_momenta(method, problem, composition)
    if not (problem.canonical or problem.slides) and method.a is not method.b:
        raise ValueError(NO_MOMENTA)
    return _of_rates(method, problem, composition)


def _separable(problem: Problem) -> bool:
    """Whether the rates of the coordinates depend on momenta alone, and the rates of these on coordinates and time."""
    if not problem.momenta:
        return mechanics(problem).separable
    states, rates = cg.variables(list(problem.states)), list(problem.rate.outputs.values())
    nq = problem.nq
    return not (reaches(rates[:nq], [*states[:nq], cg.variable(TIME)]) or reaches(rates[nq:], states[nq:]))


def _of_momenta(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    """States q and qd: momenta are read at the start, and the velocity that belongs to them is solved for."""
    graphs, n, stages = mechanics(problem), problem.nq, range(len(method.w))

    def force(q: str, v: str, t: str, target: str) -> Call:
        return Call(graphs.force, (q, v, t, "p"), (target,))

    def velocity(q: str, v: str, momentum: str, t: str, target: str) -> Call:
        return Call(graphs.velocity, (q, v, momentum, t, "p"), (target,))

    settled = velocity("q", "v", "momentum", "later", "v")
    if graphs.separable and method in (SYMPLECTIC_EULER, VERLET):
        at_start = [velocity("q", "v", "momentum", "t", "v"), copied("v", "V0")]
        body = _explicit(method, force("q", "v", "t", "F0"), at_start, force("q", "v", "later", "F0"))
        body += [settled, count(2)] if method is VERLET else [count(1)]
    else:
        turn: list[Statement] = []
        for i in stages:
            turn += [advanced(f"Q{i}", method.a[i], "q", "V"), force(f"Q{i}", f"V{i}", f"time{i}", f"F{i}")]
        for i in stages:
            turn.append(advanced(f"P{i}", method.b[i], "momentum", "F"))
            turn.append(velocity(f"Q{i}", f"V{i}", f"P{i}", f"time{i}", f"W{i}"))
        body = [*_iterated(method, turn), _added("q", "V", method.w), _added("momentum", "F", method.w)]
        body += [stage_time("later", 1.0), *[settled] * (1 if graphs.quadratic else REPEATS)]
    sizes, read = {"q": n, "v": n}, Call(graphs.momentum, ("x", "t", "p"), ("momentum",))
    start = [_parted(sizes), read, *[copied("v", f"V{i}") for i in stages]]
    return _step(method, sizes, start, [*_in_turn(composition, body), _joined(sizes)])


def _of_rates(method: Partitioned, problem: Problem, composition: Composition) -> Step:
    """States whose rates come of one graph: q and p, of stages Q and P, or any state, of stages Q alone."""
    stages = range(len(method.w))
    parts = [("q", "Q", "V", method.a), ("momentum", "P", "F", method.b)][: 2 if problem.momenta else 1]
    bases, slopes = tuple([part[0] for part in parts]), [part[2] for part in parts]
    lengths = (problem.nq, problem.size - problem.nq) if problem.momenta else (problem.size,)
    sizes = dict(zip(bases, lengths, strict=True))
    own = {f"{slope}{i}": length for i in stages for slope, length in zip(slopes, lengths, strict=True)}

    def rates(at: Sequence[str], t: str, velocity: str, i: int = 0) -> Call:
        return Call(problem.rate, (*at, t, "p"), tuple([f"{name}{i}" for name in (velocity, *slopes[1:])]))

    if method in (SYMPLECTIC_EULER, VERLET) and _separable(problem):
        now = rates(bases, "t", "V")
        body = _explicit(method, now, [now], rates(bases, "later", "V"))
    else:
        turn: list[Statement] = [count(len(stages))] if problem.momenta else []
        for velocity in ("V", "W") if problem.momenta else "W":  # twice, since an error of V comes back to V by F
            turn += [advanced(f"{stage}{i}", a[i], base, slope) for i in stages for base, stage, slope, a in parts]
            turn += [rates([f"{part[1]}{i}" for part in parts], f"time{i}", velocity, i) for i in stages]
        body = [*_iterated(method, turn), *[_added(base, slope, method.w) for base, _, slope, _ in parts]]
    start = [rates("x", "t", "V"), *[copied(f"{slope}0", f"{slope}{i}") for slope in slopes for i in stages[1:]]]
    return _step(method, sizes | own, start, [_parted(sizes), *_in_turn(composition, body), _joined(sizes)])


def _step(method: Partitioned, lengths: dict[str, int], start: list[Statement], body: list[Statement]) -> Step:
    fixed = [*numbered("change", len(method.w)), *numbered("speed", len(method.w))]
    fixed += "q_rounding momentum_rounding failed failures going turns change_old".split()
    return Step({**lengths, "failed": 1}, body, start=start, fixed=tuple(fixed), failed="failures")


def _parted(sizes: dict[str, int]) -> Call:
    """Registers of these lengths = the numbers of x, end to end."""
    numbers = dict(zip(sizes, itertools.pairwise(itertools.accumulate(sizes.values(), initial=0)), strict=True))
    return call(lambda x: {name: x[begin:end] for name, (begin, end) in numbers.items()}, x=sum(sizes.values()))


def _joined(sizes: dict[str, int]) -> Call:
    """x_new = the numbers of registers, end to end."""
    return call(lambda *parts: {"x_new": [number for part in parts for number in part]}, *sizes, **sizes)


def _in_turn(composition: Composition, body: Sequence[Statement]) -> list[Statement]:
    """The body, a step of h from t, once for every step of a composition; a step that failed is counted."""
    counted = added("failures", "failed", "failures")
    if composition is ONCE:
        return [*body, counted]
    result: list[Statement] = [copied("h", "whole_h"), copied("t", "whole_t")]
    for step, done in zip(composition.steps, itertools.accumulate(composition.steps, initial=0.0), strict=False):
        part = call(lambda h, t, step=step, done=done: {"h": step * h, "t": t + done * h}, "whole_h", "whole_t")
        result += [part, *body, counted]
    return [*result, copied("whole_h", "h")]


def _iterated(method: Partitioned, turn: Sequence[Statement]) -> list[Statement]:
    """Times and a first guess of the stages, and turns from V to W until W = V to rounding."""
    stages = range(len(method.w))
    changes, speeds = (numbered(name, len(stages)) for name in ("change", "speed"))

    def judged(turns: Node, change_old: Node, evaluations: Node, *sums: Node) -> Values:
        """Whether to go on: not when V has settled, no longer comes nearer, or is no number."""
        change, speed = (reduce(operator.add, part) for part in (sums[: len(stages)], sums[len(stages) :]))
        nearer = cg.maximum(change < change_old, turns < 2.0)
        going = (change > CONVERGED * CONVERGED * speed) * nearer * (turns + 1.0 < TURNS)
        settled = change <= DIVERGED * DIVERGED * speed + 2.0**-1000
        return {
            "going": going,
            "turns": turns + 1.0,
            "change_old": change,
            "failed": (1.0 - going) * (1.0 - settled),
            "evaluations": evaluations + float(len(stages)),
        }

    turn = list(turn)
    for i in stages:
        turn.append(total(lambda w, v, i=i: {changes[i]: (w - v) ** 2.0}, f"W{i}", f"V{i}"))
        turn += [total(lambda w, i=i: {speeds[i]: w * w}, f"W{i}"), copied(f"W{i}", f"V{i}")]
    turn.append(call(judged, "turns", "change_old", "evaluations", *changes, *speeds))
    begin = call(lambda: {"going": 1.0, "turns": 0.0, "change_old": math.inf})
    times = [stage_time(f"time{i}", float(method.c[i])) for i in stages]
    return [*times, begin, FixedPoint("going", tuple(turn))]


def _added(base: str, slope: str, weights: Fractions) -> Map:
    """base += h * (sum of weight * slope), with what rounding took off kept for the next step."""
    registers = (base, f"{base}_rounding")
    return summed(registers, registers, weights, slope)


def _explicit(method: Partitioned, force: Call, velocity: Sequence[Statement], later: Call) -> list[Statement]:
    """A step without iteration, by F0 and V0 at q and the momentum, at t, and F0 later; where M is constant."""
    half = method is VERLET
    kick = advanced("momentum", (HALF if half else Fraction(1),), "momentum", "F")
    body = [force, kick, *velocity, _added("q", "V", (Fraction(1),)), stage_time("later", 1.0)]
    return [*body, later, kick] if half else body
