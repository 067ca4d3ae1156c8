"""Torque by link and torque by joint motion: tau taken apart by partial Lagrangians, and by the joints that move."""

from __future__ import annotations

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, folded

from ...systems.model import Model, as_system
from ...systems.system import System
from ..coriolis import coriolis_matrix, require_quadratic
from ..equation import documented, mirrored
from ..equations_of_motion import bias, gravity_force
from ..formulations.lagrange_terms import lagrange_sweeps
from .torque_table import TorqueTable

_ENERGIES = {"kinetic", "potential"}


@documented
def torque_by_link(model: Model) -> TorqueTable:
    """Row k, column i: what the partial Lagrangian L_k has of tau_i, d/dt dL_k/dqd_i - dL_k/dq_i.

    The paper's Section 4.3 (Kusaka and Tanaka): since L = sum of L_k, the rows add up to tau. Rows of damping and of
    applied forces follow, where the model has them. A link that a joint does not carry has no share of its torque,
    whatever the state: such cells are zero by structure. Of a mechanism written with base parameters
    (`base_parameters`) a row is not what its body alone takes.

    Returns
    -------
    TorqueTable
        (links and what follows, n) torques [N m or N]; columns add up to tau.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0], gravity=10.0)
    >>> print(dyn.torque_by_link(arm).at([1.5707963267948966, 0.0]))  # held straight out
            joint 1  joint 2
    link 1        5        ·
    link 2       15        5
    tau          20        5
    """
    system = as_system(model)
    build = Builder()
    rows = []
    for partial in folded(system.partial_lagrangians, Builder()):
        _, rate, gradient = lagrange_sweeps(system, partial, build, system.qdd)  # Lagrange's equation by the chain rule
        with building(build):
            rows.append([p_dot - slope for p_dot, slope in zip(rate, gradient, strict=True)])
    names = names_of_partials(system)
    outside = _damping_and_forces(system, build)
    rows += outside.values()
    outputs = {f"tau{i}_{k}": entry for k, row in enumerate(rows) for i, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by link", (*names, *outside), system.velocities, system, graph, sum_axis=0)


@documented
def torque_by_joint_motion(model: Model) -> TorqueTable:
    """Row i, column j: the torque at joint i for the motion of joint j, M_ij qdd_j + C_ij qd_j.

    C is that of Christoffel's symbols (`coriolis`): of a Coriolis force, which two velocities make together, each has
    half. Columns of gravity (all that is there at rest), damping and applied forces follow, where the model has them.

    Returns
    -------
    TorqueTable
        (n, n and what follows) torques [N m or N]; rows add up to tau.

    Raises
    ------
    ValueError
        For an L that is not quadratic in the velocities.

    Examples
    --------
    >>> import dynamics as dyn
    >>> slider = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2), ["r", "theta"])
    >>> print(dyn.torque_by_joint_motion(slider).at([2.0, 0.0], [3.0, 5.0], [1.0, 1.0]))
            r  theta  tau
    r       1    -50  -49
    theta  30     34   64
    """
    system = as_system(model)
    require_quadratic(system)
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], Builder())
    mass = system.mass_matrix(lagrangian, build)  # its lower triangle
    forces = folded(bias(system).outputs.values(), build)
    coriolis = coriolis_matrix(system, forces, build, mass)
    n = system.n
    with building(build):
        pairs = zip(mirrored(mass), coriolis, strict=True)
        rows = [[m[j] * system.qdd[j] + c[j] * system.qd[j] for j in range(n)] for m, c in pairs]
    outside = {"gravity": folded(gravity_force(system).outputs.values(), build)} | _damping_and_forces(system, build)
    columns = {name: column for name, column in outside.items() if any(entry.value != 0.0 for entry in column)}
    for column in columns.values():
        rows = [[*row, entry] for row, entry in zip(rows, column, strict=True)]
    names = [*system.velocities, *columns]
    outputs = {f"tau{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))
    return TorqueTable("torque by joint motion", system.velocities, tuple(names), system, graph, sum_axis=1)


def _damping_and_forces(system: System, build: Builder) -> dict[str, list[Node]]:
    """Torques against damping and against applied forces, each where there is any."""
    damping = system.braking(build)
    with building(build):
        applied = [-force for force in folded(system.forces, build)]
    rows = {"damping": damping, "applied": applied}
    return {name: row for name, row in rows.items() if any(entry.value != 0.0 for entry in row)}


def names_of_partials(system: System) -> list[str]:
    """Names of the partial Lagrangians: their one tag, as a link's or a body's; else L1, L2, ..."""
    tags = [partial.tags - _ENERGIES for partial in system.partial_lagrangians]
    names = [next(iter(each)) if len(each) == 1 else "" for each in tags]
    unique = all(names) and len(set(names)) == len(names)
    return names if unique else [f"L{k + 1}" for k in range(len(names))]
