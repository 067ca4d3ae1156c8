"""Frames of bodies: placement, velocity, acceleration, and the Jacobian with its rate, as graphs.

Of a frame fixed to a body: V = (v, w) is the velocity of its origin and the angular velocity of the body, linear part
first, V = J qd. Velocities of joints are summed from the body to the world; J is a reverse sweep from each of the six
components, linear in qd, and rates are forward sweeps along q_dot = G(q) qd, so that ball and free joints need nothing
of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Node
from cgraph._shared import require_choice
from cgraph.extend import Builder, building, cotangents

from ...equations.bias_terms import along_motion
from ...equations.equation import Equation, Output, entries
from ...systems.kinematics import ONE
from ...systems.system import System
from ..algebra import spatial
from ..bodies.body import vector
from ..trees.mechanism import Mechanism
from .body_quantity import MECHANISM, body_quantity

AXES = ("world", "body")
FRAME = MECHANISM | {
    "body": "body : str\n    Name of the body, which may be welded on.",
    "at": "at : array_like, (3,)\n    The point, in the body's frame [m].",
    "axes": """axes : {"world", "body"}
    The axes that linear and angular parts are taken in; both are of the motion against the world.""",
}
NO_BODY = """MechanismError
    For a model without bodies, an unknown body, and a point that is not three finite numbers."""
NO_FRAME = f"{NO_BODY}\nValueError\n    For other axes."
ORIGIN = (0.0, 0.0, 0.0)
RATES = "m/s^2, then rad/s^2"


@body_quantity(Equation("q qd", Output("R_{}_{}", ("3", "3")), Output("p_{}", ("3",), "m")), FRAME, NO_BODY)
def frame_placement(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN) -> Iterator[Node]:
    """Placement of a body's frame in the world, moved to a point of the body.

    Returns
    -------
    R has the body's axes as columns in the world's, and p is where the point is in the world.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> placed = dyn.arrays_at(arm, dyn.frame_placement(arm, "link 2"), q=[1.5707963267948966, 0.0])
    >>> placed["R"].shape, placed["p"][0].tolist()
    ((3, 3), 1.0)
    """
    chain, point = mechanism.chain(body), vector(f"the point of body {body!r}: at", at)
    with building(Builder()), cg.tag(body):
        columns = chain.columns()
        yield from [columns[j][i] for i in range(3) for j in range(3)]
        yield from chain.motion(point).position


@body_quantity(Equation("q qd", Output("V_{}", ("6",), "m/s, then rad/s")), FRAME, NO_FRAME)
def frame_velocity(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN, axes: str = "world") -> list[Node]:
    """Velocity V = (v, w) of a point of a body, and of the body's rotation.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> velocity = dyn.frame_velocity(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, velocity, q=[0.0], qd=[2.0])["V"].tolist()
    [2.0, 0.0, 0.0, 0.0, -2.0, 0.0]
    """
    return _twist(mechanism, body, at, axes)


@body_quantity(Equation("q qd qdd", Output("a_{}", ("6",), RATES)), FRAME, NO_FRAME)
def frame_acceleration(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN, axes: str = "world") -> list[Node]:
    """Rate of `frame_velocity`, dV/dt = J qdd + dJ/dt qd.

    In the world's axes that is the acceleration of the point and the angular acceleration; in the body's axes the
    rates of the components, R^T a - w x v and R^T alpha. Gravity has no part in it.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> acceleration = dyn.frame_acceleration(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, acceleration, q=[0.0], qd=[2.0], qdd=[3.0])["a"].tolist()
    [3.0, 0.0, 4.0, 0.0, -3.0, 0.0]
    """
    system = mechanism.system
    return along_motion(system, _twist(mechanism, body, at, axes), Builder(), system.qdd)


@body_quantity(Equation("q qd", Output("a_{}", ("6",), RATES)), FRAME, NO_FRAME)
def frame_bias_acceleration(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN, axes: str = "world") -> list[Node]:
    """`frame_acceleration` at qdd = 0, dJ/dt qd, without forming the rate of J.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> centripetal = dyn.frame_bias_acceleration(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, centripetal, q=[0.0], qd=[2.0])["a"][2].tolist()
    4.0
    """
    return along_motion(mechanism.system, _twist(mechanism, body, at, axes), Builder(), None)


@body_quantity(Equation("q qd", Output("J_{}_{}", ("6", "n"))), FRAME, NO_FRAME)
def frame_jacobian(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN, axes: str = "world") -> list[Node]:
    """The Jacobian J of a frame, V = J qd; J^T takes a force at the point and a torque to the joints.

    Returns
    -------
    Three rows of v, then three of w, a column for each velocity [m or 1; 1 or 1/m].

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> jacobian = dyn.frame_jacobian(arm, "link 2", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, jacobian, q=[0.0, 0.0])["J"][0].tolist()
    [2.0, 1.0]
    """
    return entries(jacobian_rows(mechanism.system, _twist(mechanism, body, at, axes)))


@body_quantity(Equation("q qd", Output("Jdot_{}_{}", ("6", "n"))), FRAME, NO_FRAME)
def frame_jacobian_rate(mechanism: Mechanism, body: str, at: ArrayLike = ORIGIN, axes: str = "world") -> list[Node]:
    """The rate dJ/dt of `frame_jacobian` along the motion, entry by entry.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0])
    >>> rate = dyn.frame_jacobian_rate(arm, "link 1", at=(0.0, 0.0, -1.0))
    >>> dyn.arrays_at(arm, rate, q=[0.0], qd=[2.0])["Jdot"][2].tolist()
    [2.0]
    """
    rows = jacobian_rows(mechanism.system, _twist(mechanism, body, at, axes))
    return along_motion(mechanism.system, entries(rows), Builder(), None)


def jacobian_rows(system: System, velocities: Sequence[Node]) -> list[list[Node]]:
    """Slopes of nodes that are linear in qd along it, (len(velocities), n)."""
    build = Builder()
    return [cotangents({velocity: ONE}, system.qd, build) for velocity in velocities]


def _twist(mechanism: Mechanism, body: str, at: ArrayLike, axes: str) -> list[Node]:
    """The six components of V."""
    require_choice("axes", axes, AXES)
    chain, point = mechanism.chain(body), vector(f"the point of body {body!r}: at", at)
    with building(Builder()), cg.tag(body):
        motion = chain.motion(point)
        parts = [motion.velocity, motion.omega]
        if axes == "body":
            columns = chain.columns()
            parts = [(spatial.dot(columns[0], v), spatial.dot(columns[1], v), spatial.dot(columns[2], v))
                     for v in parts]  # fmt: skip
    return [component for part in parts for component in part]
