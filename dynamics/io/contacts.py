"""Contacts of a robot file: spheres and ends of capsules on planes and spheres, of a material that its weight gives."""

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
SINK = 0.01  # of r: how far a sphere sinks that carries the weight of the whole model; of two, 1/r = 1/r_1 + 1/r_2
CREEP = 0.1  # of sqrt(g sink): the transition velocity of friction
FRICTION = 1.0  # where the file says nothing, as in MuJoCo


class Ball(NamedTuple):
    """A sphere of a body on a plane, or a sphere, of the world or of another body."""

    body: str
    at: Array  # (3,), in the body's frame [m]
    radius: float  # m
    friction: float = FRICTION
    to: str = WORLD
    to_at: ArrayLike = (0.0, 0.0, 0.0)  # a point of the plane, or the center of the sphere [m]
    to_radius: float | None = None  # m; None: a plane
    normal: ArrayLike | None = None  # of the plane; None: against gravity


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
    said = (*left_out, *present({"contacts, as there are none of spheres or capsules of bodies that move": not balls}))
    mechanism = replace(mechanism, left_out=(*mechanism.left_out, *said))
    if not balls:
        return mechanism
    pull = np.asarray(mechanism.gravity, dtype=np.float64)
    gravity = float(np.linalg.norm(pull))
    weight = gravity * sum([float(body.mass) for body in mechanism.moving])
    if not weight:
        raise MechanismError("the stiffness of contacts follows from the weight of the model, and it has none")
    return replace(mechanism, forces=(*mechanism.forces, *[_contact(ball, weight, pull, gravity) for ball in balls]))


def standing(mechanism: Mechanism, q: Sequence[float], floating: bool) -> list[float]:
    """Coordinates, (nq,), with a root that floats, whose place they begin with, moved until a sphere just touches."""
    found, contacts = list(q), [each for each in mechanism.forces if isinstance(each, Contact)]
    if not (floating and contacts):
        return found
    state = {f"q{i}": value for i, value in enumerate(q)} | {f"qd{i}": 0.0 for i in range(mechanism.system.n)}
    depth = max([float(mechanism.contact(each).evaluate(state)["depth"]) for each in contacts])
    found[:3] = (np.array(q[:3]) + depth * np.asarray(contacts[0].normal)).tolist()
    return found


def _contact(ball: Ball, weight: float, pull: Array, gravity: float) -> Contact:
    size = ball.radius if ball.to_radius is None else 1.0 / (1.0 / ball.radius + 1.0 / ball.to_radius)
    sink = SINK * size
    falling = float(np.sqrt(gravity * sink))  # m/s
    return Contact(
        ball.body,
        ball.to,
        at=ball.at,
        to_at=ball.to_at,
        to_radius=ball.to_radius,
        normal=spatial.snapped(-pull / gravity) if ball.normal is None else ball.normal,
        radius=ball.radius,
        stiffness=weight / sink**1.5,
        dissipation=1.0 / falling,
        friction=ball.friction,
        velocity=CREEP * falling,
    )
