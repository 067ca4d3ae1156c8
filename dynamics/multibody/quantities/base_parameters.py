"""Inertial parameters: the regressor, by which torques are linear in them, and the base parameters that motion shows.

A column of the regressor that depends on those before it, at many states at once, belongs to a parameter that cannot be
told from theirs: it is added to them. So a body's numbers go to the bodies that carry it, as far as can be.
(M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8(4), 1991.)
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array
from cgraph.extend import Builder, building

from ...equations.formulations.formulations import inverse_dynamics
from ...equations.states.initial_value import normalized
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..algebra.turns import MatrixTurn
from ..bodies.body import quantities
from ..bodies.joint_coordinates import quasi_velocities
from ..sweeps.links import Link, link, link_states, motion_axes
from ..sweeps.outward import energy, ground, motions
from ..trees.mechanism import Mechanism, require_mechanism
from .frames import of_bodies

PARAMETERS = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")  # the order of Pinocchio
SAMPLES = 60  # random states: 60 n rows for 10 n columns
ROUNDING = 1e-9  # of a column's length, what is left of it beside those that it depends on
Columns = np.ndarray[tuple[int], np.dtype[np.intp]]
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
    joints = {body.name: body.joint for body in mechanism.moving}
    base = ground(quantities("gravity", mechanism.gravity))
    partials = []
    with building(Builder()):
        links = [link(body, joints.get(body.parent)) for body in mechanism.moving]
        states = link_states(mechanism.moving, links, mechanism.parents, q, qd)
        for i, (at, motion) in enumerate(zip(states, motions(states, base), strict=True)):
            with cg.tag(at.name):
                unknown = _symbolic(at.link, motion_axes(joints[at.name]), pi[10 * i : 10 * i + 10])
                partials.append(energy(motion, at._replace(link=unknown)))
    return partials


def _symbolic(known: Link, axes: Array, pi: list[Node]) -> Link:
    """The link with its inertial numbers as nodes, turned from the body's axes into those of its motion."""
    mass, x, y, z, *lower = pi
    entries = dict(zip(_LOWER, lower, strict=True))
    inertia = [[entries[max(i, j), min(i, j)] for j in range(3)] for i in range(3)]
    into = MatrixTurn(axes.T.tolist())
    first, turned = np.array(into.out((x, y, z))), into.second_moments(inertia)
    return replace(known, mass=mass, first=first, inertia=turned, damping=0.0, stiffness=0.0, armature=0.0, lift=None)


class BaseParameters(NamedTuple):
    """The combinations beta of inertial parameters pi that motion shows: Y pi = Y[:, columns] beta, beta = grouping pi.

    Parameters
    ----------
    names : tuple of str
        Of each combination, the parameter that stands for it: "Iyy of link 1".
    columns : ndarray of int, (rank,)
        Its place among all, and that of its column in the regressor.
    grouping : ndarray, (rank, 10 n)
        What of all parameters is in each combination: 1 at its own place, 0 at those of the others'.

    Examples
    --------
    >>> import dynamics as dyn
    >>> base = dyn.base_parameters(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]))
    >>> base.rank, base.names[:3]
    (6, ('mx of link 1', 'mz of link 1', 'Iyy of link 1'))
    >>> base.grouping[2, [6, 10]].round(9).tolist()  # in Iyy of link 1 are its own, and the second mass at 1 m
    [1.0, 1.0]
    """

    names: tuple[str, ...]
    columns: Columns
    grouping: Array

    @property
    def rank(self) -> int:
        """Number of combinations."""
        return len(self.names)


@of_bodies
def base_parameters(model: Model) -> BaseParameters:
    """The combinations of inertial parameters that motion shows, see `regressor`: the base parameters.

    Each stands at the body nearest the world that can have it. They depend on joints, their places and gravity alone,
    and are found at random states, of coordinates, velocities and accelerations of about 1, where a dependence to 1e-9
    is one. A matrix that is measured takes them as it takes those of all: `y[:, base.columns]`.

    Returns
    -------
    BaseParameters
        names, columns and grouping of as many as there are, `rank`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.base_parameters(dyn.planar_arm([1.0], [1.0])).names
    ('mx of link 1', 'mz of link 1', 'Iyy of link 1')
    """
    mechanism = require_mechanism(model, "base_parameters").bind()
    graph, system = regressor(mechanism), mechanism.system
    drawn = np.random.default_rng(0).normal(size=(SAMPLES, len(graph.inputs)))
    drawn[:, : system.nq] = normalized(mechanism, drawn[:, : system.nq + system.n])[:, : system.nq]
    values = graph.evaluate(dict(zip(graph.input_names, drawn.T, strict=True))).values()
    table = np.stack([np.broadcast_to(column, SAMPLES) for column in values], axis=1)
    matrix = table.astype(np.float64).reshape(SAMPLES * system.n, -1)  # the regressors, one below the other
    lengths = np.linalg.norm(matrix, axis=0)
    shown = np.flatnonzero(lengths > 0.0)
    unit = matrix[:, shown] / lengths[shown]
    kept, directions = [], np.empty((len(unit), 0))
    for k, column in enumerate(unit.T):
        rest = column
        for _ in range(2):  # twice is enough for directions at right angles to all digits
            rest = rest - directions @ (directions.T @ rest)
        if (length := float(np.linalg.norm(rest))) > ROUNDING:
            kept.append(k)
            directions = np.column_stack([directions, rest / length])
    columns, grouping = shown[kept], np.zeros((len(kept), matrix.shape[1]))
    shares = np.linalg.solve(directions.T @ unit[:, kept], directions.T @ unit)
    shares[:, kept] = np.eye(len(kept))
    shares[np.abs(shares) <= ROUNDING] = 0.0
    grouping[:, shown] = shares * lengths[shown] / lengths[columns][:, None]
    names = [f"{PARAMETERS[k % 10]} of {mechanism.moving[k // 10].name}" for k in columns.tolist()]
    return BaseParameters(tuple(names), columns, grouping)
