"""Forms: what the states of a problem are, coordinates and velocities or, by Hamilton's equations, momenta."""

from __future__ import annotations

from dataclasses import replace

from cgraph.extend import kept_by_first, require_choice

from ..equations.equations_of_motion import momentum
from ..equations.hamiltonian import FORMS, hamilton_equations, missing_momenta, velocities
from ..systems.model import as_system
from .problem import Problem


def in_form(problem: Problem, form: str) -> Problem:
    """The problem that the steps of a run are of. Raises ValueError for a form that it has not."""
    if require_choice("form", form, FORMS) == "velocity":
        return problem
    if problem.system is None:
        raise ValueError('form="momentum" needs a Lagrangian, which a system of first order does not have')
    return momentum_form(problem)


@kept_by_first
def momentum_form(problem: Problem) -> Problem:
    """The same motion in q and p = dL/dqd.

    Raises TypeError for a first-order system; ConstraintError, SingularMassMatrixError and ValueError as
    `hamilton_equations`.
    """
    system = as_system(problem.model)
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
