"""Torque by link and torque by motion: tau taken apart by partial Lagrangians, and by the joints that move."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, cotangents, folded, hessian_nodes, tangents

from ..systems.model import Model, as_system
from ..systems.system import System
from . import coriolis
from .equations_of_motion import bias, gravity_force
from .formulations import ONE, ZERO
from .torque_table import TorqueTable

_ENERGIES = {"kinetic", "potential"}


def torque_by_link(model: Model) -> TorqueTable:
    """Row k, column i: what the partial Lagrangian L_k has of tau_i, d/dt dL_k/dqd_i - dL_k/dq_i.

    Rows of damping and of applied forces follow, where the model has them; columns add up to tau. A link that a joint
    does not carry has no share of its torque, whatever the state: such cells are zero by structure.
    Of a mechanism written with base parameters (`base_parameters`) a row is not what its body alone takes.
    """
    system = as_system(model)
    build = Builder()
    rows = [_torques(system, each, build) for each in folded(system.partial_lagrangians, Builder())]
    names = _names(system)
    outside = _outside(system, build)
    rows += outside.values()
    outputs = {f"tau{i}_{k}": entry for k, row in enumerate(rows) for i, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by link", (*names, *outside), system.coordinates, system, graph, True)


def torque_by_joint_motion(model: Model) -> TorqueTable:
    """Row i, column j: the torque at joint i for the motion of joint j, M_ij qdd_j + C_ij qd_j.

    C is that of Christoffel's symbols (`coriolis`): of a Coriolis force, which two velocities make together, each has
    half. Columns of gravity (all that is there at rest), damping and applied forces follow, where the model has them;
    rows add up to tau. Raises ValueError for an L that is not quadratic in the velocities.
    """
    system = as_system(model)
    coriolis.quadratic(system)
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], Builder())
    lower = hessian_nodes(lagrangian, system.qd, build)
    forces = folded(bias(system).outputs.values(), build)
    rates = coriolis.matrix(system, forces, build)
    n = system.n
    with building(build):
        rows = [
            [lower[max(i, j)][min(i, j)] * system.qdd[j] + rates[i][j] * system.qd[j] for j in range(n)]
            for i in range(n)
        ]
    outside = {"gravity": folded(gravity_force(system).outputs.values(), build)} | _outside(system, build)
    columns = {name: column for name, column in outside.items() if any(each.value != 0.0 for each in column)}
    for column in columns.values():
        rows = [[*row, entry] for row, entry in zip(rows, column, strict=True)]
    names = [*system.coordinates, *columns]
    outputs = {f"tau{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by motion", system.coordinates, tuple(names), system, graph, False)


def _torques(system: System, partial: Node, build: Builder) -> list[Node]:
    n = system.n
    bars = cotangents({partial: ONE}, [*system.q, *system.qd], build)
    slopes, momenta = bars[:n], bars[n:]
    x_dot = dict(zip([*system.q, *system.qd], [*system.qd, *system.qdd], strict=True))
    dots = tangents(x_dot | ({system.t: ONE} if system.t in system.extra_inputs else {}), momenta, build)
    with building(build):
        return [dots.get(p, ZERO) - slope for p, slope in zip(momenta, slopes, strict=True)]


def _outside(system: System, build: Builder) -> dict[str, list[Node]]:
    """Rows of damping and of applied forces, each where there is any."""
    with building(build):
        with cg.tag("damping"):
            taken = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
        given = [-force for force in folded(system.forces, build)]
    rows = {"damping": taken, "applied": given}
    return {name: row for name, row in rows.items() if any(each.value != 0.0 for each in row)}


def _names(system: System) -> list[str]:
    """Of the partial Lagrangians: their one tag, as a link's or a body's; else L1, L2, ..."""
    names: Sequence[str] = [_only(each.tags - _ENERGIES) for each in system.partial_lagrangians]
    unique = all(names) and len(set(names)) == len(names)
    return list(names) if unique else [f"L{k + 1}" for k in range(len(names))]


def _only(tags: frozenset[str]) -> str:
    return next(iter(tags)) if len(tags) == 1 else ""
