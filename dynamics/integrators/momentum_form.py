"""MomentumForm: a problem in coordinates and momenta, by Hamilton's equations, and the way there and back."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from cgraph import Graph

from ..equations.equations_of_motion import momentum
from ..equations.hamiltonian import hamilton_equations, velocities
from ..systems.model import as_system
from .problem import KEPT, Problem


class MomentumForm(NamedTuple):
    """A mechanical problem in q and p = dL/dqd. Inputs of the graphs: states, t, parameters."""

    problem: Problem
    momenta: Graph  # of states (q, qd)
    velocities: Graph  # of states (q, p)


@lru_cache(KEPT)
def momentum_form(problem: Problem) -> MomentumForm:
    """The same motion in q and p.

    Raises TypeError for a first-order system; ConstraintError, SingularMassMatrixError and ValueError as
    `hamilton_equations`.
    """
    system = as_system(problem.model)
    states = (*problem.states[: problem.nq], *[f"p{i}" for i in range(system.n)])
    names = [f"momentum of {name!r}" for name in system.velocities]
    canonical = replace(
        problem,
        states=states,
        components=(*problem.components[: problem.nq], *names),
        rate=problem.bind(states, hamilton_equations(system)),
        momenta=True,
    )
    return MomentumForm(
        canonical, problem.bind(problem.states, momentum(system)), problem.bind(states, velocities(system))
    )
