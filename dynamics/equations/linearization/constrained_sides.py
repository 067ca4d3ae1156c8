"""Right-hand sides of a linearization with constraints, whose rows are differentiated with their multipliers."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, SingularError, building, cotangents, folded, solve_nodes, tangents

from ...systems.system import System
from ..accelerations import DENSE_UP_TO
from ..constraints.constraints import DenseSolver, Rows, constraint_rows
from ..formulations.formulations import ONE, ZERO, torques
from ..mass_matrix_solve import MassSolve, linear
from .inverse_dynamics_derivatives import state_slopes


def constrained_sides(system: System, solved: Graph, build: Builder) -> tuple[list[list[Node]], MassSolve]:
    """Right-hand sides of the 2n numbers of x, (n + m,), and the solution for one: dqdd of

    M dqdd - J^T dlambda = dtau - d(tau - J^T lambda)/dx dx,  J dqdd = -d(dz/dt)/dx dx,  z the rates of constraints.

    solved: the accelerations and multipliers.
    """
    n = system.n
    lagrangian, *rates = folded([system.lagrangian, *system.constraints.rates], build)
    rows = constraint_rows(system, rates)
    partials = _slopes(system, rows, solved, build)
    with building(build):
        sides = [[-row[j] for row in partials] for j in range(2 * n)]
    b = cg.variables([f"b{i}#" for i in range(n + len(rows.multipliers))])
    return sides, linear(b, _solved(system, lagrangian, rows, b, build)[:n])


def _solved(system: System, lagrangian: Node, rows: Rows, side: Sequence[Node], build: Builder) -> list[Node]:
    """(dqdd, -dlambda) for a right-hand side: densely up to 7 coordinates, where that goes without exchanging rows."""
    if system.n <= DENSE_UP_TO:
        with suppress(SingularError):
            return DenseSolver(system, lagrangian, rows, build).solve(side)
    function, s = rows.function(lagrangian, build), rows.multipliers
    return solve_nodes(function, [*system.qd, *s], side, build, multipliers=s)


def _slopes(system: System, rows: Rows, solved: Graph, build: Builder) -> list[list[Node]]:
    """Rows of d(tau - J^T lambda, dz/dt)/d(q, qd), (n + m, 2n), where qdd and lambda are as solved.

    Of quasi-velocities by displacements xi, dq = G xi.
    """
    tau, s = cg.simplify(torques(system)), rows.multipliers
    held = cotangents(dict(zip(rows.rates, s, strict=True)), system.qd, build)
    x_dot = dict(zip([*system.q, *system.qd], [*system.q_dot, *system.qdd], strict=True)) | {system.t: ONE}
    dots = tangents(x_dot, rows.rates, build)
    with building(build):
        equations = [torque - force for torque, force in zip(tau.outputs.values(), held, strict=True)]
    equations += [dots.get(z, ZERO) for z in rows.rates]
    entries = [entry for row in state_slopes(system, equations, build) for entry in row]
    at = {name: node for name, node in solved.outputs.items() if name in {str(each.name) for each in (*system.qdd, *s)}}
    graph = Graph([*tau.inputs, *s, *system.tau], {str(k): entry for k, entry in enumerate(entries)})
    flat = list(cg.specialize(graph, at).outputs.values())
    width = 2 * system.n
    return [flat[i : i + width] for i in range(0, len(flat), width)]
