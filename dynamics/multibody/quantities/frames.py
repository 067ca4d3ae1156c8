"""Frames of bodies: placement, velocity, acceleration, and the Jacobian with its rate, as graphs.

Of a frame fixed to a body: V = (v, w) is the velocity of its origin and the angular velocity of the body, linear part
first, V = J qd. Velocities of joints are summed from the body to the world; J is a reverse sweep from each of the six
components, linear in qd, and rates are forward sweeps along q_dot = G(q) qd, so that ball and free joints need nothing
of their own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Builder, building, cotangents, require_choice, tangents

from ...systems.kinematics import ONE
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..algebra.spatial import ZERO
from ..bodies.body import vector
from ..sweeps.kinematic_chain import KinematicChain
from ..trees.mechanism import require_mechanism

AXES = ("world", "body")


def frame_placement(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0)) -> Graph:
    """Placement of a body's frame in the world, moved to a point of the body.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.
    body : str
        Name of the body, which may be welded on.
    at : array_like, (3,)
        The point, in the body's frame [m].

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs R_0_0, R_0_1, .. row by row, (3, 3), the body's axes as columns in the
        world's, and p_0, p_1, p_2, (3,), where the point is in the world [m].

    Raises
    ------
    MechanismError
        For a model without bodies, an unknown body, and a point that is not three finite numbers.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> placed = dyn.arrays_at(arm, dyn.frame_placement(arm, "link 2"), q=[1.5707963267948966, 0.0])
    >>> placed["R"].shape, placed["p"][0].tolist()
    ((3, 3), 1.0)
    """
    system, chain, point = _frame(model, "frame_placement", body, at)
    with building(Builder()), cg.tag(body):
        columns = _columns(chain)
        outputs = {f"R_{i}_{j}": columns[j][i] for i in range(3) for j in range(3)}
        outputs |= _named("p", chain.motion(point).position)
    return cg.simplify(system.graph(outputs, system.q, system.qd))


def frame_velocity(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0), axes: str = "world") -> Graph:
    """Velocity V = (v, w) of a point of a body, and of the body's rotation.

    Parameters
    ----------
    model : Model
        A mechanism, or a scene of one.
    body : str
        Name of the body.
    at : array_like, (3,)
        The point, in the body's frame [m].
    axes : {"world", "body"}
        The axes that v and w are taken in; both are of the motion against the world.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs V_0 .. V_5, (6,): v [m/s], then w [rad/s].

    Raises
    ------
    MechanismError
        As `frame_placement`.
    ValueError
        For other axes.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> velocity = dyn.frame_velocity(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, velocity, q=[0.0], qd=[2.0])["V"].tolist()
    [2.0, 0.0, 0.0, 0.0, -2.0, 0.0]
    """
    system, twist = _twist(model, "frame_velocity", body, at, axes)
    return cg.simplify(system.graph(_named("V", twist), system.q, system.qd))


def frame_acceleration(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0), axes: str = "world") -> Graph:
    """Rate of `frame_velocity`, dV/dt = J qdd + dJ/dt qd.

    In the world's axes that is the acceleration of the point and the angular acceleration; in the body's axes the
    rates of the components, R^T a - w x v and R^T alpha. Gravity has no part in it.

    Parameters
    ----------
    model, body, at, axes
        As in `frame_velocity`.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., qdd0.., parameters; outputs a_0 .. a_5, (6,): [m/s^2], then [rad/s^2].

    Raises
    ------
    MechanismError, ValueError
        As `frame_velocity`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> acceleration = dyn.frame_acceleration(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, acceleration, q=[0.0], qd=[2.0], qdd=[3.0])["a"].tolist()
    [3.0, 0.0, 4.0, 0.0, -3.0, 0.0]
    """
    system, twist = _twist(model, "frame_acceleration", body, at, axes)
    along = _motion(system) | dict(zip(system.qd, system.qdd, strict=True))
    return cg.simplify(system.graph(_named("a", _rates(along, twist)), system.q, system.qd, system.qdd))


def frame_bias_acceleration(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0), axes: str = "world") -> Graph:
    """`frame_acceleration` at qdd = 0, dJ/dt qd, without forming the rate of J.

    Parameters
    ----------
    model, body, at, axes
        As in `frame_velocity`.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs a_0 .. a_5, (6,): [m/s^2], then [rad/s^2].

    Raises
    ------
    MechanismError, ValueError
        As `frame_velocity`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> centripetal = dyn.frame_bias_acceleration(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, centripetal, q=[0.0], qd=[2.0])["a"][2].tolist()
    4.0
    """
    system, twist = _twist(model, "frame_bias_acceleration", body, at, axes)
    return cg.simplify(system.graph(_named("a", _rates(_motion(system), twist)), system.q, system.qd))


def frame_jacobian(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0), axes: str = "world") -> Graph:
    """The Jacobian J of a frame, V = J qd; J^T takes a force at the point and a torque to the joints.

    Parameters
    ----------
    model, body, at, axes
        As in `frame_velocity`.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs J_0_0, J_0_1, .. row by row, (6, n): three rows of v, then three of w,
        a column for each velocity [m or 1; 1 or 1/m].

    Raises
    ------
    MechanismError, ValueError
        As `frame_velocity`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> jacobian = dyn.frame_jacobian(arm, "link 2", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, jacobian, q=[0.0, 0.0])["J"][0].tolist()
    [2.0, 1.0]
    """
    system, twist = _twist(model, "frame_jacobian", body, at, axes)
    return cg.simplify(system.graph(_matrix("J", jacobian_rows(system, twist)), system.q, system.qd))


def frame_jacobian_rate(model: Model, body: str, at: ArrayLike = (0.0, 0.0, 0.0), axes: str = "world") -> Graph:
    """The rate dJ/dt of `frame_jacobian` along the motion, entry by entry.

    Parameters
    ----------
    model, body, at, axes
        As in `frame_velocity`.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., parameters; outputs Jdot_0_0, Jdot_0_1, .. row by row, (6, n).

    Raises
    ------
    MechanismError, ValueError
        As `frame_velocity`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> rate = dyn.frame_jacobian_rate(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, rate, q=[0.0], qd=[2.0])["Jdot"][2].tolist()
    [2.0]
    """
    system, twist = _twist(model, "frame_jacobian_rate", body, at, axes)
    rows = jacobian_rows(system, twist)
    flat = _rates(_motion(system), [entry for row in rows for entry in row])
    rates = [flat[i * system.n : (i + 1) * system.n] for i in range(len(rows))]
    return cg.simplify(system.graph(_matrix("Jdot", rates), system.q, system.qd))


def jacobian_rows(system: System, velocities: Sequence[Node]) -> list[list[Node]]:
    """Slopes of nodes that are linear in qd along it, (len(velocities), n)."""
    build = Builder()
    return [cotangents({velocity: ONE}, system.qd, build) for velocity in velocities]


def _frame(model: Model, what: str, body: str, at: ArrayLike) -> tuple[System, KinematicChain, Array]:
    mechanism = require_mechanism(model, what)
    return mechanism.system, mechanism.chain(body), vector(f"the point of body {body!r}: at", at)


def _twist(model: Model, what: str, body: str, at: ArrayLike, axes: str) -> tuple[System, list[Node]]:
    """The six components of V."""
    require_choice("axes", axes, AXES)
    system, chain, point = _frame(model, what, body, at)
    with building(Builder()), cg.tag(body):
        motion = chain.motion(point)
        parts = [motion.velocity, motion.omega]
        if axes == "body":
            columns = _columns(chain)
            parts = [(spatial.dot(columns[0], v), spatial.dot(columns[1], v), spatial.dot(columns[2], v))
                     for v in parts]  # fmt: skip
    return system, [component for part in parts for component in part]


def _columns(chain: KinematicChain) -> list[spatial.Triple]:
    """The body's axes in the world's."""
    return [chain.direction(spatial.constant(axis)) for axis in np.eye(3)]


def _motion(system: System) -> dict[Node, Node]:
    """Rates of the coordinates."""
    return dict(zip(system.q, system.q_dot, strict=True))


def _rates(along: dict[Node, Node], nodes: Sequence[Node]) -> list[Node]:
    dots = tangents(along, nodes, Builder())
    return [dots.get(node, ZERO) for node in nodes]


def _named(name: str, values: Sequence[Node]) -> dict[str, Node]:
    return {f"{name}_{i}": value for i, value in enumerate(values)}


def _matrix(name: str, rows: Sequence[Sequence[Node]]) -> dict[str, Node]:
    return {f"{name}_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
