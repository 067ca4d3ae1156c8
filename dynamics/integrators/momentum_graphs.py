"""Mechanics: the graphs of momenta p = dL/dqd and of their rates, for methods that step coordinates and momenta."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents, hessian_nodes, solve_nodes

from .problem import KEPT, Problem, reaches

ONE = cg.constant(1.0)


class Mechanics(NamedTuple):
    """A mechanical system in q and p = dL/dqd. Inputs of the graphs: those named here, then t, parameters."""

    momentum: Graph  # (q, qd) -> p
    force: Graph  # (q, qd) -> p_dot = dL/dq + tau + forces - damping qd
    velocity: Graph  # (q, qd, p) -> qd, nearer to the velocity that belongs to p: a step of Newton, exact when K is
    # quadratic in qd
    quadratic: bool  # the momenta are linear in the velocities: M does not depend on them
    separable: bool  # p = M qd with a constant M, and the forces do not depend on the velocities


@lru_cache(KEPT)
def mechanics(problem: Problem) -> Mechanics:
    """The graphs of momenta of a problem. Raises ValueError for a system of first order, which has none."""
    system = problem.system
    if system is None:
        raise ValueError("this method keeps momenta, which a system of first order does not have")
    build = Builder()
    p = cg.variables([f"p{i}" for i in range(system.n)])
    bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd], build)
    slopes, momenta = bars[: system.n], bars[system.n :]
    with building(build):
        force = [
            slope + tau + applied - damping * qd
            for slope, tau, applied, damping, qd in zip(
                slopes, system.tau, system.forces, system.damping, system.qd, strict=True
            )
        ]
        missing = [wanted - here for wanted, here in zip(p, momenta, strict=True)]
    steps = solve_nodes(system.lagrangian, system.qd, missing, build)
    with building(build):
        velocity = [qd + step for qd, step in zip(system.qd, steps, strict=True)]

    def graph(inputs: list[Node], outputs: list[Node]) -> Graph:
        numbered = {f"{k}": node for k, node in enumerate(outputs)}
        whole = Graph([*inputs, *system.tau, *system.extra_inputs], numbered)
        return problem.bind([str(node.name) for node in inputs], whole)

    state = [*system.q, *system.qd]
    momentum, rate = graph(state, momenta), graph(state, force)
    mass_matrix = [node for row in hessian_nodes(system.lagrangian, system.qd) for node in row]
    quadratic = not reaches(mass_matrix, system.qd)
    free = not reaches(rate.outputs.values(), system.qd)
    constant = not reaches([*mass_matrix, *momentum.outputs.values()], system.q)
    return Mechanics(momentum, rate, graph([*state, *p], velocity), quadratic, free and constant and quadratic)
