"""Hand-over: the state of a mechanism just after it has caught a free body, or let one go."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..equations.equations_of_motion import forward_dynamics, momentum
from .body import Body, MechanismError, checked, vector
from .mechanism import Mechanism
from .spatial import Array

_COMPONENTS = ("x y z", "vx vy vz", "wx wy wz")


class FreeBody(NamedTuple):
    """A rigid body that moves on its own, in the world's axes."""

    position: Array  # (3,) [m] of its centre of mass
    velocity: Array  # (3,) [m/s] of its centre of mass
    omega: Array  # (3,) [rad/s]
    orientation: Array  # (3, 3), its axes as columns


class Attached(NamedTuple):
    """mechanism: with the body.  q, qd: its state after the impact.  energy: what the impact took [J]."""

    mechanism: Mechanism
    q: Array
    qd: Array
    energy: float


class Released(NamedTuple):
    """mechanism: without the body.  q, qd: its state.  body: how the body leaves."""

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

    The impact is inelastic and takes no time: positions stay, no force but its own matters, and velocities jump so
    that M qd+ = M_old qd- + J^T m v + J_w^T I w, in the coordinates of the mechanism with the body.
    q, qd: (n,), just before.  body: with its joint, "fixed" for a firm grip.  to: what it hangs on, by default its
        parent. Where it is has to be where it hangs: see `Mechanism.motion`. A joint that is new stands at 0.
    velocity: (3,) [m/s] of its centre of mass, omega: (3,) [rad/s], both in the world's axes.

    Raises as `Mechanism.attach` and `Mechanism.map_state_from`.
    """
    whole = mechanism.attach(body, to)
    v, w = vector("velocity", velocity), vector("omega", omega)
    q_new, qd_old = whole.map_state_from(mechanism, q, qd)
    coordinates = {each.name: i for i, each in enumerate(whole.moving)}
    p = np.zeros(len(coordinates))
    before = _momentum(mechanism, np.asarray(q, dtype=np.float64), np.asarray(qd, dtype=np.float64))
    p[[coordinates[each.name] for each in mechanism.moving]] = before
    given = checked(body)
    free, along, about = _motion(whole, given, q_new, qd_old)
    inertia = free.orientation @ np.asarray(given.inertia) @ free.orientation.T
    p += given.mass * along.T @ v + about.T @ inertia @ w
    qd_new = _velocities(whole, q_new, p)
    energy = float(np.asarray(qd, dtype=np.float64) @ before + given.mass * v @ v + w @ inertia @ w - qd_new @ p) / 2.0
    return Attached(whole, q_new, qd_new, energy)


def release(mechanism: Mechanism, q: ArrayLike, qd: ArrayLike, body: str) -> Released:
    """A body is let go: all velocities stay, and it leaves as the one that held it moved there.

    q, qd: (n,). Raises MechanismError for an unknown body and one that carries others, and as
    `Mechanism.map_state_from`.
    """
    bodies = mechanism.subtree(body).bodies
    if len(bodies) > 1:
        raise MechanismError(f"body {body!r} carries {bodies[1].name!r}; a body that is let go must carry no other")
    rest = mechanism.detach(body)
    values = [np.asarray(each, dtype=np.float64) for each in (q, qd)]
    q_rest, qd_rest = rest.map_state_from(mechanism, *values)
    free, _, _ = _motion(mechanism, checked(bodies[0]), *values)
    return Released(rest, q_rest, qd_rest, free)


def _motion(mechanism: Mechanism, body: Body, q: Array, qd: Array) -> tuple[FreeBody, Array, Array]:
    """How a body of the mechanism moves, and the Jacobians (3, n) of its centre's velocity and of its omega."""
    graph = mechanism.motion(body.name, body.center)
    rates = np.vstack([qd, np.eye(len(qd))])  # the state's own, then each coordinate alone
    found = graph.evaluate(_named(q=q, qd=rates.T))
    of = {name: np.broadcast_to(value, len(rates)) for name, value in found.items()}
    position, velocity, omega = (np.array([of[name] for name in names.split()]) for names in _COMPONENTS)
    turn = np.array([[of[f"R_{i}_{j}"][0] for j in range(3)] for i in range(3)])
    return FreeBody(position[:, 0], velocity[:, 0], omega[:, 0], turn), velocity[:, 1:], omega[:, 1:]


def _momentum(mechanism: Mechanism, q: Array, qd: Array) -> Array:
    """Generalized momenta M qd, (n,)."""
    found = momentum(_inertia_alone(mechanism)).evaluate(_named(q=q, qd=qd))
    return np.array(list(found.values()))


def _velocities(mechanism: Mechanism, q: Array, p: Array) -> Array:
    """M^-1 p, (n,): the accelerations at rest under p alone."""
    found = forward_dynamics(_inertia_alone(mechanism)).evaluate(_named(q=q, qd=np.zeros_like(q), tau=p))
    return np.array(list(found.values()))


def _inertia_alone(mechanism: Mechanism) -> Mechanism:
    """The mechanism without gravity, forces and springs."""
    bodies = [replace(body, joint=replace(body.joint, stiffness=0.0)) if body.joint.stiffness else body
              for body in mechanism.bodies]  # fmt: skip
    return replace(mechanism, bodies=bodies, gravity=(0.0, 0.0, 0.0), forces=(), parameters={})


def _named(**groups: Array) -> dict[str, Any]:
    return {f"{name}{i}": value for name, values in groups.items() for i, value in enumerate(values)}
