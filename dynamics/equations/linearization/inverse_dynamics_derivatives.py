"""Derivatives of inverse dynamics: dtau/dq, dtau/dqd and M with tau, as one graph."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents, folded

from ...systems.model import Model, as_system
from ...systems.system import System
from ...systems.torque_derivatives import TorqueDerivatives
from ..formulations.formulations import ONE, torques
from ..shorter_form import shorter_form
from ..substitute import substitute

Rows = Sequence[Sequence[Node]]


def inverse_dynamics_derivatives(model: Model) -> Graph:
    """tau of a motion with dtau/dq, dtau/dqd and M = dtau/dqdd, at any state.

    Of bodies they are written in closed form, of other systems by differentiation of `inverse_dynamics`. Of
    quasi-velocities, qdot = G(q) qd, dtau/dq is by small displacements xi with dq = G xi, such as a rotation vector in
    the body's axes, at fixed qd and qdd, so that all are (n, n).

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n velocities.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., qdd0.., t if needed, parameters; outputs tau0.., (n,), and row by row, (n, n) each,
        dtau_dq_0_0, .., dtau_dqd_0_0, .. and M_0_0, ... Entries of coordinates on different branches of a tree are the
        constant 0.

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0], gravity=10.0)
    >>> at = dyn.arrays_at(arm, dyn.inverse_dynamics_derivatives(arm), q=[0.0, 0.0])
    >>> list(at), at["dtau_dq"].round(12).tolist()
    (['tau', 'dtau_dq', 'dtau_dqd', 'M'], [[20.0, 5.0], [5.0, 5.0]])
    """

    def derive(system: System) -> Graph:
        found = torque_derivatives(system, system.qdd, Builder())
        outputs = {f"tau{i}": node for i, node in enumerate(found.torques)}
        for name, rows in (("dtau_dq", found.by_q), ("dtau_dqd", found.by_qd), ("M", found.mass)):
            outputs |= {f"{name}_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
        return cg.simplify(system.graph(outputs, system.q, system.qd, system.qdd))

    return shorter_form(as_system(model), derive)


def torque_derivatives(system: System, qdd: Sequence[Node], build: Builder) -> TorqueDerivatives:
    """At these accelerations, with damping and applied forces."""
    stated = system.torque_derivatives(qdd, build) if system.n > 1 else None  # of one coordinate, these are longer
    if stated is None:
        return _derived(system, qdd, build)
    torque, by_q, by_qd, _ = stated
    with building(build):
        with cg.tag("damping"):
            braking = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
        for i, (brake, force) in enumerate(zip(braking, system.forces, strict=True)):
            torque[i] = torque[i] + brake - force
            by_qd[i][i] = by_qd[i][i] + system.damping[i]
    for i, slopes in enumerate(state_slopes(system, folded(system.forces, build), build)):
        with building(build):
            row = [entry - slope for entry, slope in zip([*by_q[i], *by_qd[i]], slopes, strict=True)]
        by_q[i], by_qd[i] = row[: system.n], row[system.n :]
    return stated


def _derived(system: System, qdd: Sequence[Node], build: Builder) -> TorqueDerivatives:
    """By differentiation of inverse dynamics, a reverse sweep from each torque; M from that of the energy."""
    at = dict(zip(system.qdd, qdd, strict=True))
    torque = folded(list(cg.simplify(torques(system)).outputs.values()), build)
    slopes = state_slopes(system, torque, build)
    n = system.n
    flat = folded(substitute([*torque, *_flat(slopes)], at), build)
    rows = _rows(flat[n:], 2 * n)
    lower = system.mass_matrix(system.lagrangian, build)
    mass = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    return TorqueDerivatives(flat[:n], [row[:n] for row in rows], [row[n:] for row in rows], mass)


def state_slopes(system: System, nodes: Sequence[Node], build: Builder) -> list[list[Node]]:
    """Rows of d(nodes)/d(q, qd), 2n each; of quasi-velocities by displacements xi, dq = G xi."""
    split, bars = system.nq, [cotangents({node: ONE}, [*system.q, *system.qd], build) for node in nodes]
    return [[*system.kinematics.pulled_back(row[:split], build), *row[split:]] for row in bars]


def _flat(rows: Rows) -> list[Node]:
    return [entry for row in rows for entry in row]


def _rows(flat: Sequence[Node], width: int) -> list[list[Node]]:
    return [list(flat[k : k + width]) for k in range(0, len(flat), width)]
