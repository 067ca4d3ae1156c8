"""The whole of a mechanism: center of mass with its Jacobian, and momentum in space, as graphs.

All come from the energy of the bodies over a ground that moves: with velocity V and angular velocity W of the ground,
dK/dV is the linear and dK/dW the angular momentum about the origin, at V = W = 0; and of a potential energy
m (G . r), G any vertical, dP/dG is the first moment of mass. One reverse sweep gives the nine numbers.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph._shared import require_choice
from cgraph.extend import Builder, building, cotangents, folded

from ...equations.equation import Equation, Output, entries
from ...equations.substitute import substitute
from ...systems.kinematics import ONE
from ..algebra import spatial
from ..algebra.spatial import ZERO, Triple
from ..bodies.body import MechanismError
from ..sweeps.links import link_states
from ..sweeps.outward import Motion, energy, motions
from ..trees.mechanism import Mechanism
from .body_quantity import body_quantity
from .frames import jacobian_rows

POINTS = ("origin", "center of mass")
NO_MASS = "MechanismError\n    For a model without bodies, and where nothing that moves has mass."


class Moments(NamedTuple):
    """Mass, first moment and momentum of the bodies that move together."""

    mass: Node
    first: Triple  # sum of m r
    linear: Triple  # momentum
    angular: Triple  # momentum about the origin


@body_quantity(Equation("q qd", Output("c_{}", ("3",), "m"), Output("v_{}", ("3",), "m/s")), refused=NO_MASS)
def center_of_mass(mechanism: Mechanism) -> list[Node]:
    """Where the center of mass is, and its velocity, in the world. Bodies that are fixed to the world are left out.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> dyn.arrays_at(arm, dyn.center_of_mass(arm), q=[0.0, 0.0])["c"][2].tolist()
    -1.0
    """
    center, velocity, _ = _center(mechanism, "center_of_mass")
    return [*center, *velocity]


@body_quantity(Equation("q qd", Output("J_{}_{}", ("3", "n"), "m or 1")), refused=NO_MASS)
def center_of_mass_jacobian(mechanism: Mechanism) -> list[Node]:
    """The Jacobian J of the center of mass, velocity = J qd.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> dyn.arrays_at(arm, dyn.center_of_mass_jacobian(arm), q=[0.0, 0.0])["J"][0].tolist()
    [1.0, 0.25]
    """
    _, velocity, _ = _center(mechanism, "center_of_mass_jacobian")
    return entries(jacobian_rows(mechanism.system, velocity))


@body_quantity(Equation("q qd", Output("h_{}", ("6",), "kg m/s, then kg m^2/s")))
def spatial_momentum(mechanism: Mechanism, about: str = "origin") -> list[Node]:
    """Linear and angular momentum of the bodies together, in the world's axes; `momentum` is that of the coordinates.

    Without gravity and other forces from outside both are constant for a tree on a free base; else their rates are the
    force and the torque from outside, those that hold the joints on the world among them. What an armature adds to the
    inertia of a coordinate has no part in it, since nobody says where in space it turns.

    Parameters
    ----------
    about : {"origin", "center of mass"}
        The point that the angular momentum is about: the world's origin, or the center of mass of the bodies.

    Returns
    -------
    Three numbers of the linear momentum, then three of the angular one.

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
        moments = _moments(mechanism)
        return [*moments.linear, *moments.angular]
    center, _, moments = _center(mechanism, "spatial_momentum")
    with building(Builder()):
        taken = spatial.cross(center, moments.linear)
        return [*moments.linear, *[a - b for a, b in zip(moments.angular, taken, strict=True)]]


def _center(mechanism: Mechanism, what: str) -> tuple[Triple, Triple, Moments]:
    """The center and the velocity of the mass, and the moments that they come of."""
    moments = _moments(mechanism)
    if moments.mass.value == 0.0:
        raise MechanismError(f"{what} needs mass that moves, the bodies of the mechanism have none")
    with building(Builder()):
        center, velocity = (
            (x / moments.mass, y / moments.mass, z / moments.mass) for x, y, z in (moments.first, moments.linear)
        )
    return center, velocity, moments


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
                total = total + energy(motion, at._replace(link=replace(at.link, lift=None)))
                mass = mass + at.link.mass
    bars = cotangents({total: ONE}, ground, build)
    still = folded(substitute(bars, dict.fromkeys(ground, ZERO)), build)
    with building(build):
        first = spatial.scaled(-1.0, (still[6], still[7], still[8]))
    return Moments(mass, first, (still[0], still[1], still[2]), (still[3], still[4], still[5]))
