"""The regressor: joint forces as a matrix times the bodies' inertial parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import Builder, building

from ...equations.formulations.formulations import inverse_dynamics
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..algebra.turns import MatrixTurn
from ..bodies.body import quantities
from ..bodies.joint_coordinates import quasi_velocities
from ..sweeps.links import Link, axes_of, link, link_states
from ..sweeps.outward import energy, ground, motions
from ..trees.mechanism import Mechanism, require_mechanism
from .body_quantity import of_bodies

PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # the order of Pinocchio
_LOWER = ((0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2))  # entries of I in that order


@of_bodies
def regressor(model: Model) -> Graph:
    """Y(q, qd, qdd) with Y pi = tau - armature qdd - damping qd - spring forces + applied forces.

    pi: for each moving body the ten `PARAMETERS`, see `inertial_parameters`. Each partial Lagrangian is linear in them,
    so Y is the Jacobian of inverse dynamics by them: one reverse sweep a joint over the graph in which they are
    variables. A column of zeros is a parameter that no motion reveals; which combinations of the others do, the rank
    of stacked Y tells. Forces that balance weight count as applied.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., qdd0.., parameters; outputs Y_0_0, Y_0_1, .. row by row, (n, 10 n).

    Examples
    --------
    >>> import dynamics as dyn
    >>> len(dyn.regressor(dyn.planar_arm([1.0, 0.8], [1.0, 0.5])).outputs)
    40
    """
    mechanism = require_mechanism(model, "a regressor")
    names = [f"{each}_{i}" for i in range(len(mechanism.moving)) for each in PARAMETERS]
    while set(names) & mechanism.parameter_values.keys():
        names = [f"{name}_" for name in names]
    system = System(
        lambda q, qd, t, p: _partial_lagrangians(mechanism, q, qd, [p[name] for name in names]),
        mechanism.coordinates,
        dict.fromkeys(names, 0.0) | mechanism.parameter_values,
        quasi_velocities=quasi_velocities(mechanism.moving),
    )
    slopes = cg.jacobian(inverse_dynamics(system), names).outputs.values()
    width = len(names)
    outputs = {f"Y_{k // width}_{k % width}": slope for k, slope in enumerate(slopes)}
    parameters = cg.variables(list(mechanism.parameter_values))
    return cg.simplify(Graph([*system.q, *system.qd, *system.qdd, *parameters], outputs))


@of_bodies
def inertial_parameters(model: Model) -> Array:
    """Mass, first moment and inertia about the joint's origin of each moving body, all that is welded to it merged in.

    Returns
    -------
    ndarray, (n, 10)
        In the bodies' axes, columns as `PARAMETERS`: m [kg], m c [kg m], and Ixx, Ixy, Iyy, Ixz, Iyz, Izz [kg m^2].
        Of the mechanism's own parameters it takes the values.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.inertial_parameters(dyn.planar_arm([2.0], [3.0], mass_model="point"))[0, :4].tolist()
    [2.0, 0.0, 0.0, -6.0]
    """
    rows = []
    for body in require_mechanism(model, "inertial_parameters").bind().moving:
        mass, center = float(body.mass), np.asarray(body.center)
        inertia = spatial.parallel_axis(np.asarray(body.inertia), mass, center)
        rows.append([mass, *(mass * center), *(inertia[i, j] for i, j in _LOWER)])
    return np.array(rows)


def _partial_lagrangians(mechanism: Mechanism, q: list[Node], qd: list[Node], pi: list[Node]) -> list[Node]:
    bodies = {body.name: body for body in mechanism.moving}
    base = ground(quantities("gravity", mechanism.gravity))
    partials = []
    with building(Builder()):
        links = [link(body, bodies.get(body.parent)) for body in mechanism.moving]
        states = link_states(mechanism.moving, links, mechanism.parents, q, qd)
        for i, (at, motion) in enumerate(zip(states, motions(states, base), strict=True)):
            with cg.tag(at.name):
                unknown = _symbolic(at.link, axes_of(bodies[at.name]), pi[10 * i : 10 * i + 10])
                partials.append(energy(motion, at._replace(link=unknown)))
    return partials


def _symbolic(known: Link, axes: Array, pi: list[Node]) -> Link:
    """The link with its inertial numbers as nodes, turned from the body's axes into those of its motion."""
    mass, x, y, z, *lower = pi
    entries = dict(zip(_LOWER, lower, strict=True))
    inertia = [[entries[max(i, j), min(i, j)] for j in range(3)] for i in range(3)]
    into = MatrixTurn(axes.T.tolist())
    moment, turned = into.out((x, y, z)), into.second_moments(inertia)
    return replace(known, mass=mass, moment=moment, inertia=turned, damping=0.0, stiffness=0.0, armature=0.0, lift=None)
