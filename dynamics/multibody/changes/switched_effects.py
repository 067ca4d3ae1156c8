"""Gravity, damping, springs, armature and forces switched off in a model, or put in where they are absent."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import Any

from ...equations.equations_of_motion import gravity_force
from ...systems.model import Model, as_system
from ...systems.system import System
from ..bodies.body import Body
from ..bodies.composed_joints import locked_parts, parts_of
from ..bodies.joint_coordinates import places
from ..parameters import vanishes
from ..trees.mechanism import Mechanism, as_mechanism
from ..trees.structure import changed

EFFECTS = ("gravity", "damping", "springs", "armature", "forces")
FREE_FALL = (0.0, 0.0, -9.81)  # m/s^2, put in to count what gravity would take
SKEW = (-3.0, -5.0, -7.0)  # m/s^2, along no axis
NUMBER = 0.3  # put in for a damping, stiffness, .. that a model has not
_JOINT = {"damping": "damping", "springs": "stiffness", "armature": "armature"}
_ABLE = {"springs": "sprung", "armature": "geared"}  # what the type of a joint that can have it says


def has_effect(model: Model, effect: str) -> bool:
    """Whether the model has an effect. Raises ValueError for one that cannot be told apart."""
    mechanism = as_mechanism(model)
    if mechanism is not None:
        if effect in _JOINT:
            return not all(vanishes(getattr(body.joint, _JOINT[effect])) for body in mechanism.moving)
        return not vanishes(mechanism.gravity) if effect == "gravity" else bool(mechanism.forces)
    system = as_system(model)
    if effect == "damping":
        return not vanishes(system.damping)
    if effect == "forces":
        return any(force.value != 0.0 for force in system.forces)
    raise ValueError(f"the Lagrangian of {model!r:.60} is given as a whole: {effect} cannot be told apart in it")


def without_effect(model: Model, effect: str) -> Model:
    """The model with that effect switched off."""
    mechanism = as_mechanism(model)
    if mechanism is not None:
        if effect == "gravity":
            return changed(mechanism, gravity=(0.0, 0.0, 0.0))
        return changed(mechanism, forces=()) if effect == "forces" else _with(mechanism, effect, 0.0)
    system = as_system(model)
    return System(
        lambda q, qd, t: system.partial_lagrangians,
        system.coordinates,
        system.parameters,
        forces=(lambda q, qd, t: system.forces) if effect == "damping" else None,
        damping=0.0 if effect == "damping" else system.damping,
    )


def _with(model: Mechanism, effect: str, number: float, among: Collection[str] | None = None) -> Mechanism:
    """The mechanism with that damping, stiffness or armature at the joints of those bodies, or at all that move."""
    change: dict[str, Any] = {_JOINT[effect]: number}
    if effect == "springs" and not number:
        change["spring_reference"] = 0.0

    names = [body.name for body in model.bodies if body.joint.moves] if among is None else among
    return _replaced(model, names, lambda body: replace(body, joint=replace(body.joint, **change)))


def absent_parts(model: Mechanism, given: Mechanism) -> Iterator[tuple[str, str, Mechanism]]:
    """What, why, and the model with it. given: the model before anything was switched off, which is not absent."""
    model, given = _in_parts(model), _in_parts(given)
    if vanishes(given.gravity):
        yield "gravity", "it is zero", changed(model, gravity=FREE_FALL)
    elif not vanishes(model.gravity):
        forces = list(gravity_force(_with(model, "springs", 0.0)).outputs.values())
        along = [forces[place.u] for place in places(model.moving)]
        still = [all([force.value == 0.0 for force in each]) for each in along]
        free = [body.name for body, none in zip(model.moving, still, strict=True) if none]
        if free:
            yield f"gravity at {_listed(free)}", "it does no work there", changed(model, gravity=SKEW)
    for effect, name in _JOINT.items():
        had = {body.name for body in given.moving if not vanishes(getattr(body.joint, name))}
        able = [body for body in model.moving if getattr(body.joint.type, _ABLE.get(effect, "moves"))]
        without = [body.name for body in able if vanishes(getattr(body.joint, name)) and body.name not in had]
        if without:
            yield f"{effect} of {_listed(without)}", "it is zero", _with(model, effect, NUMBER, without)
    if massless := [body.name for body in model.bodies if not _frame(model, body) and not _has_inertia(body)]:
        heavy: dict[str, Any] = {"mass": 1.0, "center": (0.1, 0.2, 0.3), "inertia": (0.1, 0.2, 0.25)}
        with_mass = _replaced(model, massless, lambda body: replace(body, **heavy))
        yield f"mass of {_listed(massless)}", "it is zero", with_mass
    if welds := [body.name for body in model.bodies if not (body.joint.moves or vanishes(body.mass))]:
        hinge: dict[str, Any] = {"kind": "revolute", "armature": NUMBER}
        hinged = _replaced(model, welds, lambda body: replace(body, joint=replace(body.joint, **hinge)))
        yield f"joint of {_listed(welds)}", "it is welded on", hinged


def _in_parts(model: Mechanism) -> Mechanism:
    """The mechanism with bodies on composed joints as the bodies that they are, whose names `moving` has."""
    bodies = [part for body in model.bodies for part in parts_of(body)]
    if len(bodies) == len(model.bodies):
        return model
    return replace(model, bodies=bodies, locked=locked_parts(model.bodies, model.locked))


def _has_inertia(body: Body) -> bool:
    return not (vanishes(body.mass) and vanishes(body.inertia))


def _frame(model: Mechanism, body: Body) -> bool:
    """Whether a body only marks a place: welded on, without mass, carrying nothing."""
    carries = any(body.name == other.parent for other in model.bodies)
    return not (carries or body.joint.moves or _has_inertia(body))


def _replaced(model: Mechanism, names: Collection[str], change: Callable[[Body], Body]) -> Mechanism:
    return changed(model, bodies=tuple([change(body) if body.name in names else body for body in model.bodies]))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"{len(names) - 3} more"])
