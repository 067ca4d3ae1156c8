"""Blocks: the numbers of a row that kernels read and write, and where they lie."""

from __future__ import annotations

from typing import NamedTuple

STRIDE, WIDE, FREEDOM = 16, 32, 24  # numbers from a row to the next in registers, and from a freedom to the next
MOST = 6  # freedoms of a joint


class Block(NamedTuple):
    """A block of numbers.

    register, table: from which register, and the places where it begins there.  length: of numbers; 0 where joints say.
    """

    register: str
    table: str
    length: int = 0


# fmt: off
BLOCKS = {
    # turn (rows), place, pitch; mass, first moment, inertia (lower triangle); damping, stiffness, spring reference,
    # armature; mass and first moment of what is weightless
    "numbers": Block("numbers", "wide", 31),
    "pose": Block("pose", "own", 12),  # turn (rows) and place against the parent, as the joint stands
    # angular velocity, angular acceleration, acceleration of the origin against free fall
    "motion": Block("motion", "own", 9),
    "carrier": Block("motion", "parent", 9),
    "wrench": Block("wrench", "own", 6),  # force, torque about the origin
    "carried": Block("wrench", "parent", 6),
    "vertical": Block("vertical", "own", 3),  # acceleration of the world against free fall
    "up": Block("vertical", "parent", 3),
    # articulated inertia: lower triangles of N and M; H
    "stiff": Block("stiff", "own", 12),
    "stiff in": Block("stiff", "parent", 12),
    "coupling": Block("coupling", "own", 9),
    "coupling in": Block("coupling", "parent", 9),
    "gain": Block("gains", "gain"),  # of each freedom a wrench over its pivot; then accelerations
    "relative": Block("relative", "own", 6),  # acceleration beside that with joints that do not accelerate
    "base": Block("relative", "parent", 6),
    # angular velocity, velocity of the origin, vertical (as long as gravity is strong), depth along it
    "height": Block("height", "own", 10),
    "height in": Block("height", "parent", 10),
    "energy": Block("energy", "", 2),  # kinetic, potential
    "place": Block("place", "own", 15),  # axes (columns), origin, that from the parent's
    "place in": Block("place", "parent", 15),
    "outer place": Block("place", "outer row", 15),
    "moving": Block("moving", "own", 12),  # velocity, acceleration against free fall
    "moving in": Block("moving", "parent", 12),
    "mass": Block("mass", "wide", 28),  # `MovingInertia`
    "mass in": Block("mass", "wide parent", 28),
    "column": Block("column", "freedom"),  # of each freedom S, psi', psi'', psi' + S'
    "outer column": Block("column", "outer", FREEDOM),
    "reaction": Block("reaction", "freedom"),  # of each freedom, with the origin that it is about
    "inner reaction": Block("reaction", "inner", FREEDOM),
    # dtau/dq, dtau/dqd and M: of the freedoms of a joint, row by row; of two freedoms
    **{f"entries {k}": Block("slopes", f"entries {k}") for k in range(MOST)},
    "outer inner": Block("slopes", "outer inner", 3),
    "inner outer": Block("slopes", "inner outer", 3),
    "q": Block("x", "q"),
    "u": Block("x", "u"),
}
# fmt: on
ACCELERATED = {"a": Block("x", "v"), "tau": Block("tau", "result")}  # accelerations are given
DRIVEN = {"tau": Block("x", "v"), "a": Block("a", "result")}  # torques are
PAIRS = ("outer", "inner", "outer row", "outer inner", "inner outer")  # tables of pairs of freedoms
