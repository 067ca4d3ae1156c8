"""Contacts of a robot file: spheres and ends of capsules on planes and spheres, of a material that its weight gives."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from cgraph._shared import Array, real_number, require_choice, require_mapping

from ..multibody.forces.contact import CONTACT_QUANTITIES, Contact
from ..multibody.trees.mechanism import WORLD, Mechanism, MechanismError
from .left_out import present

COMPLIANT = "compliant"
Material: TypeAlias = str | Mapping[str, float | str]  # "compliant", or quantities of `Contact` beside it
SINK = 0.01  # of r: how far a sphere sinks that carries the weight of the whole model; of two, 1/r = 1/r_1 + 1/r_2
CREEP = 0.1  # of sqrt(g sink): the transition velocity of friction
OF_WEIGHT = ("stiffness", "dissipation", "velocity")  # what follows from the weight where it is not given
FRICTION = 1.0  # where the file says nothing, as in MuJoCo


def untaken(takeable: bool) -> str:
    """The sentence on contacts that are left out.  takeable: whether there are shapes of which they are taken."""
    return f"contacts{' (the option contacts takes those of spheres and capsules)' * takeable}"


def asked(contacts: Material | None) -> Mapping[str, float | str] | None:
    """What contacts have in place of numbers that follow from the file; None where they are not taken.

    Raises ValueError for a text that is not "compliant" and for what is no quantity of a `Contact`, and TypeError.
    """
    if contacts is None:
        return None
    if isinstance(contacts, str):
        if contacts != COMPLIANT:
            known = ", ".join(CONTACT_QUANTITIES)
            raise ValueError(f"contacts must be {COMPLIANT!r}, or numbers or names of {known}, got {contacts!r:.60}")
        return {}
    for name, value in require_mapping("contacts", contacts, "quantity of a Contact: number or name").items():
        require_choice("a quantity of contacts", name, tuple(CONTACT_QUANTITIES))
        if not isinstance(value, str):
            real_number(f"contacts: {name}", value)
    return dict(contacts)


def capsule_ends(center: Array, axis: Array, half: float) -> list[Array]:
    """Centers of the spheres at the ends of a capsule."""
    return [center - half * axis, center + half * axis]


def with_contacts(
    mechanism: Mechanism, material: Mapping[str, float | str], balls: Sequence[Contact], left_out: Sequence[str]
) -> Mechanism:
    """The mechanism with the contacts of balls, those that move, to which its weight gives their material.

    material: see `asked`; a name is a parameter of the number that all contacts have.  left_out: sentences on contacts
    that are not among them.
    Raises MechanismError for numbers of a weight that is not there, and a parameter in place of different numbers.
    """
    balls = [ball for ball in balls if mechanism.carriers[ball.body].name != WORLD]
    said = (*left_out, *present({"contacts, as there are none of spheres or capsules of bodies that move": not balls}))
    mechanism = replace(mechanism, left_out=(*mechanism.left_out, *said))
    if not balls:
        return mechanism
    gravity = float(np.linalg.norm(np.asarray(mechanism.gravity, dtype=np.float64)))
    weight = gravity * sum([float(body.mass) for body in mechanism.moving])
    following = [what for what in OF_WEIGHT if isinstance(material.get(what, ""), str)]
    if following and not weight:
        raise MechanismError(f"contacts of a model without weight need numbers for {', '.join(following)}")
    contacts = [_of_material(ball, weight, gravity or 1.0) for ball in balls]
    parameters = dict(mechanism.parameters)
    for what, name in material.items():
        if isinstance(name, str):
            own = [getattr(contact, what) for contact in contacts]
            if min(own) < max(own):
                differ = f"{what} of the contacts is from {min(own):.6g} to {max(own):.6g}"
                raise MechanismError(f"{differ}, and the parameter {name!r:.60} would have one value; give it a number")
            if name in parameters:
                raise MechanismError(f"{what} of the contacts: there is a parameter {name!r:.60} already")
            parameters[name] = own[0]
    options: Any = material
    contacts = [replace(contact, **options) for contact in contacts]
    return replace(mechanism, forces=(*mechanism.forces, *contacts), parameters=parameters)


def standing(mechanism: Mechanism, q: Sequence[float], floating: bool) -> list[float]:
    """Coordinates, (nq,), with a root that floats, whose place they begin with, moved until a sphere just touches."""
    found, contacts = list(q), [each for each in mechanism.forces if isinstance(each, Contact)]
    if not (floating and contacts):
        return found
    state = {f"q{i}": value for i, value in enumerate(q)} | {f"qd{i}": 0.0 for i in range(mechanism.system.n)}
    depth = max([float(mechanism.contact(each).evaluate(state)["depth"]) for each in contacts])
    found[:3] = (np.array(q[:3]) + depth * np.asarray(contacts[0].normal)).tolist()
    return found


def _of_material(ball: Contact, weight: float, gravity: float) -> Contact:
    sink = SINK * (ball.radius if ball.to_radius is None else 1.0 / (1.0 / ball.radius + 1.0 / ball.to_radius))
    falling = float(np.sqrt(gravity * sink))  # m/s
    return replace(ball, stiffness=weight / sink**1.5, dissipation=1.0 / falling, velocity=CREEP * falling)
