"""Hand-over: the state of a mechanism just after it has caught a free body, or let one go."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, real_array

from ...equations.equations_of_motion import forward_dynamics, momentum
from ...equations.states.evaluate import arrays_at
from ..bodies.body import Body, MechanismError, vector
from ..trees.mechanism import Mechanism, require_mechanism
from ..trees.structure import bound_body, checked_parts

_COMPONENTS = ("x y z", "vx vy vz", "wx wy wz")


class FreeBody(NamedTuple):
    """A rigid body that moves on its own, in the world's axes.

    Parameters
    ----------
    position, velocity : ndarray, (3,)
        Of its center of mass [m], [m/s].
    omega : ndarray, (3,)
        Angular velocity [rad/s].
    orientation : ndarray, (3, 3)
        Its axes as columns.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5])
    >>> body = dyn.release(arm.detach("tip"), [0.0, 0.0], [1.0, 0.0], "link 2").body
    >>> body.velocity.round(12).tolist()
    [1.25, 0.0, 0.0]
    """

    position: Array  # (3,) [m] of its center of mass
    velocity: Array  # (3,) [m/s] of its center of mass
    omega: Array  # (3,) [rad/s]
    orientation: Array  # (3, 3), its axes as columns


class Attached(NamedTuple):
    """A mechanism that has caught a body.

    Parameters
    ----------
    mechanism : Mechanism
        With the body.
    q, qd : ndarray, (n,)
        Its state after the impact [rad or m], [rad/s or m/s].
    energy : float
        What the impact took [J].

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Mechanism([dyn.Body("rotor", dyn.Joint("revolute"), inertia=(1.0, 1.0, 1.0))])
    >>> ring = dyn.Body("ring", dyn.Joint("fixed"), "rotor", mass=1.0, inertia=(1.0, 1.0, 1.0))
    >>> caught = dyn.attach_with_impact(rotor, [0.0], [2.0], ring)
    >>> caught.qd.tolist(), caught.energy
    ([1.0], 1.0)
    """

    mechanism: Mechanism
    q: Array
    qd: Array
    energy: float


class Released(NamedTuple):
    """A mechanism that has let a body go.

    Parameters
    ----------
    mechanism : Mechanism
        Without the body.
    q, qd : ndarray, (n,)
        Its state [rad or m], [rad/s or m/s].
    body : FreeBody
        How the body leaves.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5]).detach("tip")
    >>> dyn.release(arm, [0.1, 0.2], [0.0, 0.0], "link 2").q.tolist()
    [0.1]
    """

    mechanism: Mechanism
    q: Array
    qd: Array
    body: FreeBody


def attach_with_impact(
    mechanism: Mechanism,
    q: ArrayLike,
    qd: ArrayLike,
    body: Body,
    to: str | None = None,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    omega: ArrayLike = (0.0, 0.0, 0.0),
) -> Attached:
    """A free body is caught, and hangs from then on as its joint says.

    The impact is inelastic and instantaneous: positions stay, and velocities jump so that
    M qd+ = M_old qd- + J^T m v + J_w^T I w, in the coordinates of the mechanism with the body; with loops, by their
    impulses too, to velocities that keep them closed.

    Parameters
    ----------
    mechanism : Mechanism
        Without the body.
    q, qd : array_like, (n,)
        Its state just before [rad or m], [rad/s or m/s].
    body : Body
        With its joint, "fixed" for a firm grip; it has to be where it hangs (`Mechanism.motion`). A new joint is at 0.
    to : str, optional
        What it hangs on, by default its parent.
    velocity, omega : array_like, (3,)
        Velocity of its center of mass [m/s] and angular velocity [rad/s] before, in the world's axes.

    Returns
    -------
    Attached
        The mechanism with the body, its state just after, and the energy that the impact took.

    Raises
    ------
    MechanismError, ValueError
        As `Mechanism.attach` and `Mechanism.map_state_from` do.

    Examples
    --------
    >>> import dynamics as dyn
    >>> cart = dyn.Mechanism([dyn.Body("cart", dyn.Joint("prismatic", (1.0, 0.0, 0.0)), mass=1.0)])
    >>> ball = dyn.Body("ball", dyn.Joint("fixed"), "cart", mass=3.0)
    >>> dyn.attach_with_impact(cart, [0.0], [0.0], ball, velocity=(2.0, 0.0, 0.0)).qd.tolist()
    [1.5]
    """
    mechanism = require_mechanism(mechanism, "attach_with_impact")
    whole = mechanism.attach(body, to)
    v, w = vector("velocity", velocity), vector("omega", omega)
    q, qd = real_array("q", q), real_array("qd", qd)
    q_new, qd_old = whole.map_state_from(mechanism, q, qd)
    index = {name: i for i, name in enumerate(whole.velocities)}
    p = np.zeros(len(index))
    alone = _inertia_alone(mechanism.bind())
    before = arrays_at(alone, momentum(alone), q, qd)["p"]
    p[[index[name] for name in mechanism.velocities]] = before
    given = checked_parts(bound_body(body, whole.parameter_values))[-1]
    mass = float(given.mass)
    free, linear, angular = _motion(whole.bind(), given, q_new, qd_old)
    inertia = free.orientation @ np.asarray(given.inertia) @ free.orientation.T
    p += mass * linear.T @ v + angular.T @ inertia @ w
    alone = _inertia_alone(whole.bind())
    qd_new = arrays_at(alone, forward_dynamics(alone), q_new, tau=p)["qdd"]  # M^-1 p; what loops let through of it
    energy = float(qd @ before + mass * v @ v + w @ inertia @ w - qd_new @ p) / 2.0
    return Attached(whole, q_new, qd_new, energy)


def release(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike, body: str) -> Released:
    """A body is let go, by its loops too: all velocities stay, and it leaves as the one that held it moved there.

    Parameters
    ----------
    mechanism : Mechanism
        With the body.
    q, qd : array_like, (n,)
        Its state [rad or m], [rad/s or m/s].
    body : str
        Name of a body that carries no other.

    Returns
    -------
    Released
        The mechanism without the body, its state, and how the body leaves.

    Raises
    ------
    MechanismError
        For an unknown body and one that carries others.
    ValueError
        For states of another shape.

    Examples
    --------
    >>> import dynamics as dyn
    >>> rotor = dyn.Body("rotor", dyn.Joint("revolute"), inertia=(1.0, 1.0, 1.0))
    >>> ball = dyn.Body("ball", dyn.Joint("fixed", position=(0.5, 0.0, 0.0)), "rotor", mass=1.0)
    >>> dyn.release(dyn.Mechanism([rotor, ball]), [0.0], [2.0], "ball").body.velocity[1].tolist()
    1.0
    """
    mechanism = require_mechanism(mechanism, "release")
    bodies = mechanism.subtree(body).bodies
    if len(bodies) > 1:
        raise MechanismError(f"body {body!r} carries {bodies[1].name!r}; a body that is let go must carry no other")
    rest = mechanism.detach(body)
    values = real_array("q", q), real_array("qd", qd)
    q_rest, qd_rest = rest.map_state_from(mechanism, *values)
    given = checked_parts(bound_body(bodies[0], mechanism.parameter_values))[-1]
    free, _, _ = _motion(mechanism.bind(), given, *values)
    return Released(rest, q_rest, qd_rest, free)


def _motion(mechanism: Mechanism, body: Body, q: Array, qd: Array) -> tuple[FreeBody, Array, Array]:
    """Motion of a body of the mechanism, and the Jacobians (3, n) of its center's velocity and of its omega."""
    graph = mechanism.motion(body.name, np.asarray(body.center))
    rates = np.vstack([qd, np.eye(len(qd))])  # the state's own, then each coordinate alone
    found = graph.evaluate(dict(zip(graph.input_names, [*q, *rates.T], strict=True)))
    of = {name: np.broadcast_to(value, len(rates)) for name, value in found.items()}
    position, velocity, omega = (np.array([of[name] for name in names.split()]) for names in _COMPONENTS)
    turn = np.array([[of[f"R_{i}_{j}"][0] for j in range(3)] for i in range(3)])
    return FreeBody(position[:, 0], velocity[:, 0], omega[:, 0], turn), velocity[:, 1:], omega[:, 1:]


def _inertia_alone(mechanism: Mechanism) -> Mechanism:
    """The mechanism, of numbers alone, without gravity, forces and springs."""
    bodies = [replace(body, joint=replace(body.joint, stiffness=0.0)) if body.joint.stiffness else body
              for body in mechanism.bodies]  # fmt: skip
    return replace(mechanism, bodies=bodies, gravity=(0.0, 0.0, 0.0), forces=(), parameters={})
