"""Compositions: kinds of joints that are several joints of one axis, one after another."""

from __future__ import annotations

from typing import NamedTuple

AXIS, SECOND, THIRD = range(3)  # the joint's axis, its second axis, and what is across both, axis x second


class Part(NamedTuple):
    """One of the joints, from the parent outwards."""

    name: str  # what its coordinate is called after the name of the whole
    kind: str
    along: int  # AXIS, SECOND or THIRD


COMPOSITIONS = {
    "cylindrical": (Part("shift", "prismatic", AXIS), Part("angle", "revolute", AXIS)),
    "universal": (Part("angle1", "revolute", AXIS), Part("angle2", "revolute", SECOND)),
    "planar": (Part("x", "prismatic", SECOND), Part("y", "prismatic", THIRD), Part("angle", "revolute", AXIS)),
}
