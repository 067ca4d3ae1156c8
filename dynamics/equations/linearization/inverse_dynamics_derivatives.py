"""Derivatives of inverse dynamics: dtau/dq, dtau/dqd and M with tau, as one graph."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, building, cotangents, folded

from ...systems.body_terms import TorqueDerivatives
from ...systems.kinematics import ONE, Kinematics, substitute
from ...systems.system import System
from ..equation import Equation, Output, entries, mirrored
from ..formulations.lagrange_terms import torques

ROWS = ("n", "n")


@Equation(
    "q qd qdd",
    Output("tau{}", ("n",), "N m or N"),
    Output("dtau_dq_{}_{}", ROWS, "N m, N or N/m"),
    Output("dtau_dqd_{}_{}", ROWS, "N m s, N s or N s/m"),
    Output("M_{}_{}", ROWS, "kg m^2, kg m or kg"),
)
def inverse_dynamics_derivatives(system: System) -> Iterator[list[Node]]:
    """Torque tau of a motion with dtau/dq, dtau/dqd and M = dtau/dqdd, at any state.

    Of bodies they are written in closed form, of other systems by differentiation of `inverse_dynamics`. Of
    quasi-velocities, qdot = G(q) qd, dtau/dq is by small displacements xi with dq = G xi, such as a rotation vector in
    the body's axes, at fixed qd and qdd, so that all are (n, n).

    Returns
    -------
    Entries of coordinates on different branches of a tree are the constant 0.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0], gravity=10.0)
    >>> at = dyn.arrays_at(arm, dyn.inverse_dynamics_derivatives(arm), q=[0.0, 0.0])
    >>> list(at), at["dtau_dq"].round(12).tolist()
    (['tau', 'dtau_dq', 'dtau_dqd', 'M'], [[20.0, 5.0], [5.0, 5.0]])
    """
    found = torque_derivatives(system, dict(zip(system.qdd, system.qdd, strict=True)), Builder())
    yield [*found.torques, *entries([*found.by_q, *found.by_qd, *found.mass])]


def torque_derivatives(
    system: System, at: Mapping[Node, Node], build: Builder, pulls: Sequence[Node] = ()
) -> TorqueDerivatives:
    """Derivatives with damping and applied forces.

    at: the accelerations, and multipliers of constraints, at which they are taken.  pulls: the forces J^T lambda of
    constraints, which are applied forces, too.
    """
    stated = None
    if system.body_terms is not None and system.n > 1:  # of one coordinate, these are longer
        state = system.q, system.qd, [at[each] for each in system.qdd]
        stated = system.body_terms.equations.torque_derivatives(state, build)
    if stated is None:
        return _derived(system, at, build, pulls)
    torque, by_q, by_qd, _ = stated
    braking, forces = system.braking(build), folded(system.forces, build)
    with building(build):
        forces = [force + pull for force, pull in zip(forces, pulls, strict=True)] if pulls else forces
        for i, (brake, force) in enumerate(zip(braking, forces, strict=True)):
            torque[i] = torque[i] + brake - force
            by_qd[i] = [slope + damping for slope, damping in zip(by_qd[i], system.damping_rows[i], strict=True)]
    for i, slopes in enumerate(state_slopes(system.kinematics, forces, build)):
        slopes = folded(slopes, build, at) if pulls else slopes
        with building(build):
            row = [entry - slope for entry, slope in zip([*by_q[i], *by_qd[i]], slopes, strict=True)]
        by_q[i], by_qd[i] = row[: system.n], row[system.n :]
    return stated


def _derived(system: System, at: Mapping[Node, Node], build: Builder, pulls: Sequence[Node]) -> TorqueDerivatives:
    """Derivatives from inverse dynamics by a reverse sweep from each torque; M from that of the energy."""
    torque, n = folded(list(cg.simplify(torques(system)).outputs.values()), build), system.n
    if pulls:
        with building(build):
            torque = [tau - pull for tau, pull in zip(torque, pulls, strict=True)]
    slopes = state_slopes(system.kinematics, torque, build)
    flat = folded(substitute([*torque, *entries(slopes)], at), build)
    rows = [flat[k : k + 2 * n] for k in range(n, len(flat), 2 * n)]
    mass = mirrored(system.mass_matrix(system.lagrangian, build))
    return TorqueDerivatives(flat[:n], [row[:n] for row in rows], [row[n:] for row in rows], mass)


def state_slopes(kinematics: Kinematics, nodes: Sequence[Node], build: Builder) -> list[list[Node]]:
    """Rows of d(nodes)/d(q, qd), 2n each; of quasi-velocities by displacements xi, dq = G xi."""
    split, state = len(kinematics.q), [*kinematics.q, *kinematics.u]
    bars = [cotangents({node: ONE}, state, build) for node in nodes]
    return [[*kinematics.pulled_back(row[:split], build), *row[split:]] for row in bars]
