"""Momenta p = dL/dqd: their graphs, for methods that step q and p, and the problem whose states these are."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import kept_by_first, require_choice
from cgraph.extend import Builder, SingularError, building, cotangents, solve_nodes

from ..equations.equations_of_motion import momentum
from ..equations.mass_matrix.singular_mass_matrix import SingularMassMatrixError
from ..equations.state_equation import FORMS
from ..systems.arguments import new_variables
from ..systems.system import System
from .problem import Problem, reaches

ONE = cg.constant(1.0)


class Mechanics(NamedTuple):
    """A mechanical system in q and p = dL/dqd. Inputs of the graphs: those named here, then t, parameters."""

    momentum: Graph  # (q, qd) -> p
    force: Graph  # (q, qd) -> p_dot = dL/dq + tau + forces - damping qd
    velocity: Graph  # (q, qd, p, t, parameters, singular) -> qd, nearer to the velocity that belongs to p: a step of
    # Newton, exact when K is quadratic in qd; and singular, if it was 0: 0 where M is positive definite, else
    # 1 + the index of a coordinate without inertia
    quadratic: bool  # the momenta are linear in the velocities: M does not depend on them
    separable: bool  # p = M qd with a constant M, and the forces do not depend on the velocities


@kept_by_first
def mechanics(problem: Problem) -> Mechanics:
    """The graphs of momenta of a problem.

    Raises ValueError for a system that has none, of first order, with quasi-velocities or with constraints;
    SingularMassMatrixError for a coordinate without inertia.
    """
    system = problem.system
    if system is None or not problem.canonical:
        raise ValueError("this method steps momenta dL/dqd of coordinates, which the model does not have")
    build = Builder()
    p = new_variables("p", system.n, system.parameters)
    bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd], build)
    slopes, momenta = bars[: system.n], bars[system.n :]
    with building(build):
        parts = zip(slopes, system.tau, system.forces, system.damping, system.qd, strict=True)
        force = [slope + tau + applied - damping * qd for slope, tau, applied, damping, qd in parts]
        missing = [wanted - here for wanted, here in zip(p, momenta, strict=True)]
    (before,) = new_variables("singular", 1, system.parameters)
    try:
        *steps, info = _solved(system, missing, build)
    except SingularError as error:
        raise SingularMassMatrixError(
            f"the mass matrix is singular: coordinate {system.coordinates[error.index]!r} has no inertia, or none that "
            "others do not share, and a method that steps momenta needs it"
        ) from None
    with building(build):
        velocity = [qd + step for qd, step in zip(system.qd, steps, strict=True)]
        singular = cg.where(before, before, info)

    def graph(inputs: list[Node], outputs: list[Node], *last: Node) -> Graph:
        numbered = {f"{k}": node for k, node in enumerate(outputs)}
        whole = Graph([*inputs, *last, *system.tau, *system.extra_inputs], numbered)
        bound = problem.bind([str(node.name) for node in (*inputs, *last)], whole)
        return Graph([node for node in bound.inputs if node not in last] + list(last), bound.outputs)

    state = [*system.q, *system.qd]
    momentum, rate = graph(state, momenta), graph(state, force)
    mass_matrix = [node for row in system.mass_matrix(system.lagrangian) for node in row]
    quadratic = not reaches(mass_matrix, system.qd)
    free = not reaches(rate.outputs.values(), system.qd)
    constant = not reaches([*mass_matrix, *momentum.outputs.values()], [*system.q, system.t])
    solved = graph([*state, *p], [*velocity, singular], before)
    return Mechanics(momentum, rate, solved, quadratic, free and constant and quadratic)


def _solved(system: System, rhs: list[Node], build: Builder) -> list[Node]:
    """M^-1 rhs, and the info of `solve_nodes`: always 0 where a constant of M is negative, which divides as well."""
    try:
        return solve_nodes(system.lagrangian, system.qd, rhs, build, check=True)
    except SingularError as error:
        if not error.pivot:
            raise
    return [*solve_nodes(system.lagrangian, system.qd, rhs, build), cg.constant(0.0)]


def in_form(problem: Problem, form: str) -> Problem:
    """The problem that the steps of a run are of. Raises ValueError for a form that it has not."""
    if require_choice("form", form, FORMS) == "velocity":
        return problem
    return momentum_form(problem)


@kept_by_first
def momentum_form(problem: Problem) -> Problem:
    """Problem of the motion in q and p = dL/dqd.

    Raises ValueError for a first-order system; ConstraintError, SingularMassMatrixError and ValueError as
    `hamilton_equations`.
    """
    from ..equations.momentum.hamiltonian import hamilton_equations, missing_momenta, velocities

    system = problem.system
    if system is None:
        raise ValueError('form="momentum" needs a Lagrangian, which a system of first order does not have')
    states = (*problem.states[: problem.nq], *[f"p{i}" for i in range(system.n)])
    names = [f"momentum of {name!r}" for name in system.velocities]
    missing = missing_momenta(system)
    return replace(
        problem,
        states=states,
        components=(*problem.components[: problem.nq], *names),
        rate=problem.bind(states, hamilton_equations(system)),
        velocities=problem.bind(states, velocities(system)),
        momentum=problem.bind(problem.states, momentum(system)),
        missing=missing and problem.bind(states, missing),
    )
