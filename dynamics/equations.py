"""Equations of motion as graphs: mass matrix, bias, momentum, energy, and forward dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cgraph as cg
from cgraph import Graph, Node
from cgraph.fold import Builder
from cgraph.hessian_solve import solve_nodes
from cgraph.jacobian import hessian_nodes
from cgraph.label import building
from cgraph.ldl import SingularError, ldl_solve
from cgraph.reverse import cotangents

from .formulations import ONE, ZERO, chain_rule, substituted
from .system import System, as_system


class SingularMassMatrixError(ValueError):
    """A coordinate that has no inertia, so that its acceleration is not determined."""


def mass_matrix(model: Any) -> Graph:
    """M(q), the part of tau that multiplies qdd: M = d2L/dqd2.

    Inputs q0.., qd0.. (M depends on qd only for a Lagrangian that is not quadratic), t if needed, parameters.
    Outputs M_0_0, M_0_1, .. row by row, (n, n) symmetric [kg m^2, kg m or kg].
    """
    system = as_system(model)
    lower = hessian_nodes(system.lagrangian, system.qd)
    n = system.n
    outputs = {f"M_{i}_{j}": lower[max(i, j)][min(i, j)] for i in range(n) for j in range(n)}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def bias(model: Any) -> Graph:
    """Coriolis, centrifugal and gravity force together: tau at qdd = 0 without damping and applied forces.

    Inputs q0.., qd0.., t if needed, parameters; outputs bias0.. [N m or N].
    """
    system = as_system(model)
    outputs = {f"bias{i}": node for i, node in enumerate(_bias(system, Builder()))}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def gravity_force(model: Any) -> Graph:
    """The bias at rest: dP/dq, from gravity and springs.

    Inputs q0.., qd0.., t if needed, parameters; outputs gravity0.. [N m or N].
    """
    system = as_system(model)
    at_rest = substituted(_bias(system, Builder()), dict.fromkeys(system.qd, ZERO))
    return cg.simplify(system.graph({f"gravity{i}": node for i, node in enumerate(at_rest)}, system.q, system.qd))


def momentum(model: Any) -> Graph:
    """Generalized momenta p = dL/dqd. Inputs q0.., qd0.., t if needed, parameters; outputs p0.. ."""
    system = as_system(model)
    bars = cotangents({system.lagrangian: ONE}, system.qd)
    return cg.simplify(system.graph({f"p{i}": bar for i, bar in enumerate(bars)}, system.q, system.qd))


def energy(model: Any) -> Graph:
    """Total energy E = qd . dL/dqd - L, which is K + P for a kinetic energy quadratic in qd.

    Inputs q0.., qd0.., t if needed, parameters; output E [J].
    """
    system = as_system(model)
    build = Builder()
    bars = cotangents({system.lagrangian: ONE}, system.qd, build)
    with building(build):
        total: Node = ZERO
        for p, qd in zip(bars, system.qd, strict=True):
            total = total + p * qd
        total = total - system.lagrangian
    return cg.simplify(system.graph({"E": total}, system.q, system.qd))


METHODS = ("auto", "recursive", "dense")
SHORT = 6  # coordinates; beyond, the dense graph is larger on a tree of bodies, and takes long to build


def forward_dynamics(model: Any, method: str = "auto") -> Graph:
    """Accelerations: qdd = M^-1 (tau + forces - damping * qd - bias), from the Lagrangian alone.

    Inputs q0.., qd0.., tau0.., t if needed, parameters; outputs qdd0.. [rad/s^2 or m/s^2].
    method: "recursive", elimination on the graph of L without forming M (`cg.hessian_solve`): for a tree of bodies the
    number of nodes is linear in n. "dense", M factored as LDL^T: smaller for very short arms. "auto", the smaller of
    the two up to 6 coordinates, else recursive.
    Raises SingularMassMatrixError, naming the coordinate, when M is singular by structure; where M is singular at one
    state only, the result there is infinite or NaN. Raises ValueError for an unknown method.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, got {method!r}")
    system = as_system(model)
    build = Builder()
    known = _bias(system, build)
    with building(build):
        with cg.tag("damping"):
            braking = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
        rhs = [
            tau - b - brake + force
            for tau, b, brake, force in zip(system.tau, known, braking, system.forces, strict=True)
        ]
    graphs = []
    try:
        if method != "dense":
            graphs.append(_accelerations(system, solve_nodes(system.lagrangian, system.qd, rhs, build)))
        if method == "dense" or (method == "auto" and system.n <= SHORT):
            graphs.append(_accelerations(system, ldl_solve(hessian_nodes(system.lagrangian, system.qd), rhs)))
    except SingularError as error:
        name = system.coordinates[error.index]
        raise SingularMassMatrixError(
            f"the mass matrix is singular: coordinate {name!r} has no inertia of its own"
        ) from None
    return min(graphs, key=lambda graph: len(graph.nodes))


def _accelerations(system: System, solved: Sequence[Node]) -> Graph:
    outputs = {f"qdd{i}": node for i, node in enumerate(solved)}
    return cg.simplify(system.graph(outputs, system.q, system.qd, system.tau))


def _bias(system: System, build: Builder) -> list[Node]:
    terms = chain_rule(system)
    with building(build):
        tau = [rate - slope for rate, slope in zip(terms.momentum_rate, terms.gradient, strict=True)]
    still = cg.Graph([*terms.inputs, *system.extra_inputs], {f"tau{i}": node for i, node in enumerate(tau)})
    return list(cg.specialize(still, dict.fromkeys([str(node.name) for node in system.qdd], 0.0)).outputs.values())
