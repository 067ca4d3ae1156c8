"""Contacts of a robot file: its spheres and the ends of its capsules on planes, of a material that its weight gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import Array, require_choice

from ..multibody.algebra import spatial
from ..multibody.forces.contact import Contact
from ..multibody.trees.mechanism import WORLD, Mechanism, MechanismError
from .left_out import present

COMPLIANT = "compliant"
SINK = 0.01  # of its radius: how far a sphere sinks that carries the weight of the whole model
CREEP = 0.1  # of sqrt(g sink): the transition velocity of friction
FRICTION = 1.0  # where the file says nothing, as in MuJoCo


class Ball(NamedTuple):
    """A sphere of a body on a plane of the world."""

    body: str
    at: Array  # (3,), in the body's frame [m]
    radius: float  # m
    friction: float = FRICTION
    plane: ArrayLike = (0.0, 0.0, 0.0)  # a point of it [m]
    normal: ArrayLike | None = None  # None: against gravity


def untaken(takeable: bool) -> str:
    """The sentence on contacts that are left out.  takeable: whether there are shapes of which they are taken."""
    return f"contacts{' (the option contacts takes those of spheres and capsules)' * takeable}"


def asked(contacts: str | None) -> bool:
    """Whether contacts are taken. Raises ValueError for what is neither None nor "compliant"."""
    return contacts is not None and require_choice("contacts", contacts, (COMPLIANT,)) == COMPLIANT


def capsule_ends(center: Array, axis: Array, half: float) -> list[Array]:
    """Centers of the spheres at the ends of a capsule."""
    return [center - half * axis, center + half * axis]


def with_contacts(mechanism: Mechanism, balls: Sequence[Ball], left_out: Sequence[str]) -> Mechanism:
    """The mechanism with contacts of the balls, of those that move. Raises MechanismError where nothing has weight.

    left_out: sentences on contacts that are not among them.
    """
    balls = [ball for ball in balls if mechanism.carriers[ball.body].name != WORLD]
    said = (*left_out, *present({"contacts, as no sphere or capsule of a body that moves is on a plane": not balls}))
    mechanism = replace(mechanism, left_out=(*mechanism.left_out, *said))
    if not balls:
        return mechanism
    pull = np.asarray(mechanism.gravity, dtype=np.float64)
    gravity = float(np.linalg.norm(pull))
    weight = gravity * sum([float(body.mass) for body in mechanism.moving])
    if not weight:
        raise MechanismError("the stiffness of contacts follows from the weight of the model, and it has none")
    return replace(mechanism, forces=(*mechanism.forces, *[_contact(ball, weight, pull, gravity) for ball in balls]))


def _contact(ball: Ball, weight: float, pull: Array, gravity: float) -> Contact:
    sink = SINK * ball.radius
    falling = float(np.sqrt(gravity * sink))  # m/s
    return Contact(
        ball.body,
        at=ball.at,
        to_at=ball.plane,
        normal=spatial.snapped(-pull / gravity) if ball.normal is None else ball.normal,
        radius=ball.radius,
        stiffness=weight / sink**1.5,
        dissipation=1.0 / falling,
        friction=ball.friction,
        velocity=CREEP * falling,
    )
