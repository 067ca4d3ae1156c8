"""Which joints of a URDF mimic which, and which of these a mechanism cannot have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ..multibody.mechanism import MechanismError
from .left_out import listed, present

_SINGLE = ("continuous", "revolute", "prismatic")  # joints with one coordinate


class Mimics(NamedTuple):
    """Joints that mimic others, and sentences on those that do not go in."""

    leaders: dict[str, str]  # of each that follows, the joint that it mimics
    refused: list[str]
    of_no_effect: list[str]


def read_mimics(joints: Mapping[str, Element]) -> Mimics:
    """The joints that mimic others. Raises MechanismError for a joint that mimics several."""
    leaders: dict[str, str] = {}
    for name, joint in joints.items():
        if len(mimics := joint.findall("mimic")) > 1:
            raise MechanismError(f"joint {name!r} has {len(mimics)} elements <mimic>, and one is needed")
        if mimics:
            leaders[name] = mimics[0].get("joint", "")
    kinds = {name: joint.get("type") for name, joint in joints.items()}
    fixed = [name for name in leaders if kinds[name] == "fixed"]
    follow = [name for name in leaders if name not in fixed]
    astray = [name for name in follow if leaders[name] not in joints]
    circle = [name for name in follow if follows_itself(name, leaders)]
    others = [name for name in follow if name not in (*astray, *circle)]
    several = [name for name in others if not {kinds[name], kinds[leaders[name]]} <= {*_SINGLE}]
    refused = {
        "joints that mimic one that is not there": astray,
        "joints that mimic one another in a circle": circle,
        "joints that mimic others where one of both has not one coordinate": several,
    }
    return Mimics(
        {name: leaders[name] for name in others if name not in several},
        present({f"{what} ({_after(names, leaders)})": names for what, names in refused.items()}),
        present({f"fixed joints that mimic others ({_after(fixed, leaders)})": fixed}),
    )


def follows_itself(name: str, leaders: Mapping[str, str]) -> bool:
    """Whether a joint mimics itself, by way of others."""
    at, seen = leaders[name], {name}
    while at in leaders and at not in seen:
        seen.add(at)
        at = leaders[at]
    return at == name


def _after(names: Sequence[str], leaders: Mapping[str, str]) -> str:
    return listed([f"{name} after {leaders[name]}" for name in names])
