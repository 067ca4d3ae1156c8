"""The whole of a mechanism: center of mass with its Jacobian, and momentum in space, as graphs.

All come from the energy of the bodies over a ground that moves: with velocity V and angular velocity W of the ground,
dK/dV is the linear and dK/dW the angular momentum about the origin, at V = W = 0; and of a potential energy
m (G . r), G any vertical, dP/dG is the first moment of mass. One reverse sweep gives the nine numbers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents, folded, require_choice

from ...equations.substitute import substitute
from ...systems.kinematics import ONE
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..algebra.spatial import ZERO, Triple
from ..bodies.body import MechanismError
from ..sweeps.links import link_states
from ..sweeps.outward import Motion, energy, motions
from ..trees.mechanism import Mechanism, require_mechanism
from .frames import jacobian_rows

POINTS = ("origin", "center of mass")


class Moments(NamedTuple):
    """Mass, first moment and momentum of the bodies that move together."""

    mass: Node
    first: Triple  # sum of m r
    linear: Triple  # momentum
    angular: Triple  # momentum about the origin


def center_of_mass(model: Model) -> Graph:
    """Position and velocity of the center of mass. Bodies that are fixed to the world are left out.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs c_0, c_1, c_2, (3,), in the world [m], and v_0, v_1, v_2, (3,) [m/s].

    Raises
    ------
    MechanismError
        For a model without bodies, and where nothing that moves has mass.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> dyn.arrays_at(arm, dyn.center_of_mass(arm), q=[0.0, 0.0])["c"][2].tolist()
    -1.0
    """
    system, center, velocity, _ = _center(model, "center_of_mass")
    outputs = {f"c_{i}": node for i, node in enumerate(center)} | {f"v_{i}": node for i, node in enumerate(velocity)}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def center_of_mass_jacobian(model: Model) -> Graph:
    """The Jacobian J of the center of mass, velocity = J qd.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs J_0_0, J_0_1, .. row by row, (3, n) [m or 1].

    Raises
    ------
    MechanismError
        As `center_of_mass`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> dyn.arrays_at(arm, dyn.center_of_mass_jacobian(arm), q=[0.0, 0.0])["J"][0].tolist()
    [1.0, 0.25]
    """
    system, _, velocity, _ = _center(model, "center_of_mass_jacobian")
    rows = jacobian_rows(system, velocity)
    outputs = {f"J_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def spatial_momentum(model: Model, about: str = "origin") -> Graph:
    """Linear and angular momentum of the bodies together, in the world's axes; `momentum` is that of the coordinates.

    Without gravity and other forces from outside both are constant for a tree on a free base; else their rates are the
    force and the torque from outside, those that hold the joints on the world among them. What an armature adds to the
    inertia of a coordinate has no part in it, since nobody says where in space it turns.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.
    about : {"origin", "center of mass"}
        The point that the angular momentum is about: the world's origin, or the center of mass of the bodies.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs h_0 .. h_5, (6,): linear [kg m/s], then angular [kg m^2/s].

    Raises
    ------
    MechanismError
        For a model without bodies, and, about the center of mass, where nothing that moves has mass.
    ValueError
        For another point.

    Examples
    --------
    >>> import dynamics as dyn
    >>> puck = dyn.Mechanism([dyn.Body("puck", dyn.Joint("free"), mass=2.0, inertia=(1.0, 1.0, 2.0))])
    >>> state = {"q": [0.0, 5.0, 0.0, 1.0, 0.0, 0.0, 0.0], "qd": [1.0, 0.0, 0.0, 0.0, 0.0, 4.0]}
    >>> dyn.arrays_at(puck, dyn.spatial_momentum(puck), **state)["h"].tolist()
    [2.0, 0.0, 0.0, 0.0, 0.0, -2.0]
    """
    if require_choice("about", about, POINTS) == "origin":
        mechanism = require_mechanism(model, "spatial_momentum")
        system, moments = mechanism.system, _moments(mechanism)
        angular = moments.angular
    else:
        system, center, _, moments = _center(model, "spatial_momentum")
        with building(Builder()):
            x, y, z = (a - b for a, b in zip(moments.angular, spatial.cross(center, moments.linear), strict=True))
        angular = x, y, z
    outputs = {f"h_{i}": node for i, node in enumerate((*moments.linear, *angular))}
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def _center(model: Model, what: str) -> tuple[System, Triple, Triple, Moments]:
    """The system, center and velocity of the mass, and the moments that they come of."""
    mechanism = require_mechanism(model, what)
    moments = _moments(mechanism)
    if moments.mass.value == 0.0:
        raise MechanismError(f"{what} needs mass that moves, the bodies of the mechanism have none")
    with building(Builder()):
        center, velocity = (
            (x / moments.mass, y / moments.mass, z / moments.mass) for x, y, z in (moments.first, moments.linear)
        )
    return mechanism.system, center, velocity, moments


def _moments(mechanism: Mechanism) -> Moments:
    """Moments of the bodies with their own inertia, which base parameters would put on others."""
    mechanism = replace(mechanism, base_parameters=False) if mechanism.base_parameters else mechanism
    system = mechanism.system
    ground = cg.variables([f"qd{system.n + i}" for i in range(9)])  # after the joints'; no parameter has such a name
    linear, angular, vertical = ((ground[i], ground[i + 1], ground[i + 2]) for i in (0, 3, 6))
    build = Builder()
    with building(build):
        total: Node = ZERO
        mass: Node = ZERO
        states = link_states(mechanism.moving, mechanism.links, mechanism.parents, system.q, system.qd)
        for at, motion in zip(states, motions(states, Motion(angular, linear, vertical, ZERO)), strict=True):
            with cg.tag(at.name):
                total = total + energy(motion, at)
                mass = mass + at.link.mass
    bars = cotangents({total: ONE}, ground, build)
    still = folded(substitute(bars, dict.fromkeys(ground, ZERO)), build)
    with building(build):
        first = spatial.scaled(-1.0, (still[6], still[7], still[8]))
    return Moments(mass, first, (still[0], still[1], still[2]), (still[3], still[4], still[5]))
