"""Quantities of bodies as graphs: frames, with velocity, acceleration, Jacobian and its rate, and all bodies together.

Of a frame fixed to a body: V = (v, w) is the velocity of its origin and the angular velocity of the body, linear part
first, V = J qd. Velocities of joints are summed from the body to the world; J is a reverse sweep from each of the six
components, linear in qd, and rates are forward sweeps along q_dot = G(q) qd, so that ball and free joints need nothing
of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial, update_wrapper
from inspect import signature
from typing import Concatenate, NamedTuple

from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import require_choice
from cgraph.extend import Builder, building, cotangents, folded

from ...equations.bias_terms import along_motion
from ...equations.equation import Equation, GraphOfModel, More, Output, documented, entries
from ...systems.kinematics import ONE, substitute
from ...systems.model import Model
from ...systems.system import System
from ..algebra import spatial
from ..algebra.spatial import ZERO, Triple
from ..bodies.body import MechanismError, vector
from ..sweeps.links import link_states
from ..sweeps.outward import Motion, energy, motions
from ..trees.mechanism import Mechanism, require_mechanism

MECHANISM = {"model": "model : Model\n    A mechanism, or a scene of one."}
NO_BODIES = "MechanismError\n    For a model without bodies."

of_bodies = partial(documented, known=MECHANISM, refused=NO_BODIES)
"""As `documented`, of a function whose model needs bodies."""


def body_quantity(
    row: Equation, known: Mapping[str, str] = MECHANISM, refused: str = NO_BODIES
) -> Callable[[Callable[Concatenate[Mechanism, More], Iterable[Node]]], GraphOfModel[More]]:
    """The decorator of a derivation, the nodes of all outputs of a mechanism: it makes the public function of a model.

    known, refused: as of `documented`.
    """

    def decorate(derivation: Callable[Concatenate[Mechanism, More], Iterable[Node]]) -> GraphOfModel[More]:
        def graph(model: Model, *more: More.args, **named: More.kwargs) -> Graph:
            mechanism = require_mechanism(model, derivation.__name__)
            return cg.simplify(row.graph(mechanism.system, [*derivation(mechanism, *more, **named)]))

        update_wrapper(graph, derivation)
        first, *others = signature(derivation).parameters.values()
        taken = [first.replace(name="model", annotation="Model"), *others]
        graph.__signature__ = signature(derivation).replace(parameters=taken, return_annotation="Graph")  # type: ignore[attr-defined]
        graph.__annotations__ = {each.name: each.annotation for each in taken} | {"return": "Graph"}
        return documented(graph, row.returns, known, refused)

    return decorate


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
