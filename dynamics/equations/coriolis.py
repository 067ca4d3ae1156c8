"""The Coriolis matrix of Christoffel's symbols, and viscous damping, as graphs."""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, folded, hessian_nodes, tangents, topological

from ..systems.model import Model, as_system
from ..systems.system import System
from .equations_of_motion import bias
from .formulations import ONE, ZERO, substituted


def coriolis(model: Model) -> Graph:
    """C(q, qd) with C qd + gravity_force = bias and dM/dt - 2 C skew.

    The Coriolis force is quadratic in qd with Christoffel's symbols as coefficients, c_i = sum_jk Gamma_ijk qd_j qd_k,
    and these are symmetric in j and k. So C = (d bias / d qd) / 2: one forward sweep a column over the graph of the
    bias. Forces linear in qd (gyroscopic, magnetic) would be halved by that; they count in full, and being skew they
    leave dM/dt - 2 C skew. Where L depends on t, so do they, and dM/dt - 2 C is skew less twice dM/dt at fixed q.

    Inputs q0.., qd0.., t if needed, parameters; outputs C_0_0, C_0_1, .. row by row, (n, n) [N m s or N s].
    Raises ValueError for an L that is not quadratic in the velocities.
    """
    system = as_system(model)
    quadratic(system)
    forces = bias(system).outputs
    outputs = {
        f"C_{i}_{j}": entry
        for i, row in enumerate(matrix(system, list(forces.values()), Builder()))
        for j, entry in enumerate(row)
    }
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def matrix(system: System, forces: list[Node], build: Builder) -> list[list[Node]]:
    """Rows of C from the nodes of the bias."""
    columns = [tangents({velocity: ONE}, forces, build) for velocity in system.qd]
    slopes = [[column.get(force, ZERO) for column in columns] for force in forces]
    at_rest = dict.fromkeys(system.qd, ZERO)
    linear = folded(substituted([entry for row in slopes for entry in row], at_rest), build)
    with building(build):
        halves = [0.5 * (a + b) for a, b in zip([entry for row in slopes for entry in row], linear, strict=True)]
    return [halves[i * system.n : (i + 1) * system.n] for i in range(system.n)]


def quadratic(system: System) -> None:
    """Raises ValueError unless L is quadratic in the velocities, that is, M does not depend on them."""
    (lagrangian,) = folded([system.lagrangian], Builder())
    rows = hessian_nodes(lagrangian, system.qd)
    moving = set(topological([entry for row in rows for entry in row])) & set(system.qd)
    if moving:
        name = min(str(node.name) for node in moving)
        raise ValueError(f"the Lagrangian must be quadratic in the velocities, its mass matrix depends on {name}")


def damping_force(model: Model) -> Graph:
    """The torque that viscous damping takes, D qd. Inputs q0.., qd0..; outputs damping0.. [N m or N]."""
    system = as_system(model)
    with building(Builder()), cg.tag("damping"):
        taken = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
    return system.graph({f"damping{i}": node for i, node in enumerate(taken)}, system.q, system.qd)
