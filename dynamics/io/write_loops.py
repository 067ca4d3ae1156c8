"""Loops written: MJCF's equality constraints, of sites where they hold frames, and URDF's mimic."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from ..multibody.algebra import spatial
from ..multibody.loops import Loop
from ..multibody.parameters import Quantities
from ..multibody.trees.mechanism import WORLD, Mechanism, MechanismError
from .left_out import follows_itself


def numbers(values: Quantities) -> str:
    """The numbers, with blanks between."""
    return " ".join([repr(float(value)) for value in np.asarray(values)])


_DEGREE = 4  # of MJCF's polycoef
_OF_SITES = {"point": "connect", "weld": "weld"}


def equality_lines(mechanism: Mechanism) -> list[str]:
    """The element <equality>, none without loops. Raises MechanismError for a loop that MJCF has not."""
    lines = []
    for loop in mechanism.loops:
        name = f"name={quoteattr(loop.label)}"
        if loop.kind == "coupling":
            joints = [f"joint{k}={quoteattr(each)}" for k, each in enumerate(_coupled(mechanism, loop, "MJCF"), 1)]
            polynomial = _polynomial(loop, _DEGREE, "MJCF")
            lines.append(f'    <joint {name} {" ".join(joints)} polycoef="{numbers(polynomial)}"/>')
        elif loop.kind in _OF_SITES:
            sites = [f"site{k}={quoteattr(each)}" for k, each in enumerate(_sites(loop), 1)]
            lines.append(f"    <{_OF_SITES[loop.kind]} {name} {' '.join(sites)}/>")
        else:
            raise MechanismError(f"MJCF has no loop of the kind {loop.kind!r}, as is {loop.label!r}")
    return ["  <equality>", *lines, "  </equality>"] if lines else []


def site_lines(loops: Sequence[Loop]) -> dict[str, list[str]]:
    """The sites that equality constraints hold together, by the body that each is on."""
    lines: dict[str, list[str]] = {}
    for loop in loops:
        if loop.kind not in _OF_SITES:
            continue
        turn = spatial.to_quaternion(np.asarray(loop.orientation if loop.kind == "weld" else np.eye(3), np.float64))
        ends = (loop.body, loop.at, np.eye(4)[0]), (loop.to, loop.to_at, turn)
        for name, (body, at, quaternion) in zip(_sites(loop), ends, strict=True):
            place = f'pos="{numbers(np.asarray(at))}" quat="{numbers(quaternion)}"'
            lines.setdefault(body, []).append(f"<site name={quoteattr(name)} {place}/>")
    return lines


def mimic_lines(mechanism: Mechanism) -> dict[str, str]:
    """The elements <mimic>, by the body whose joint follows. Raises MechanismError for a loop that URDF has not."""
    lines: dict[str, str] = {}
    leaders: dict[str, str] = {}
    for loop in mechanism.loops:
        where = f"loop {loop.label!r}"
        if loop.kind != "coupling" or loop.to == WORLD:
            what = f"of the kind {loop.kind!r}" if loop.kind != "coupling" else "that holds one joint alone"
            raise MechanismError(f"URDF has no loop {what}, as is {loop.label!r}")
        _, leader = _coupled(mechanism, loop, "URDF")
        offset, multiplier = _polynomial(loop, 1, "URDF")
        if loop.body in lines:
            raise MechanismError(f"in URDF a joint mimics one other, and {where} is the second of body {loop.body!r}")
        leaders[loop.body] = loop.to
        if follows_itself(loop.body, leaders):
            raise MechanismError(f"in URDF no joint mimics itself by way of others, and with {where} one does")
        lines[loop.body] = f'<mimic joint={quoteattr(leader)} multiplier="{multiplier!r}" offset="{offset!r}"/>'
    return lines


def _sites(loop: Loop) -> tuple[str, str]:
    """Names of a loop's sites, which no other's have."""
    return f"{loop.label} at", f"{loop.label} to"


def _coupled(mechanism: Mechanism, loop: Loop, form: str) -> list[str]:
    """Names of the joints of a coupling."""
    parts = {body.name: body for body in mechanism.parts}
    bodies = [parts[name] for name in (loop.body, loop.to) if name != WORLD]
    for body in bodies:
        if not body.joint.type.moves:
            raise MechanismError(
                f"{form} has a locked joint as a weld, and loop {loop.label!r} couples that of {body.name!r}"
            )
    return [body.coordinate for body in bodies]


def _polynomial(loop: Loop, degree: int, form: str) -> list[float]:
    """The coefficients of a coupling, those of all degrees that the format has."""
    coefficients = [float(each) for each in loop.coefficients]
    if any(coefficients[degree + 1 :]):
        raise MechanismError(f"{form} has couplings of degree {degree} at most, and loop {loop.label!r} is of more")
    return [*coefficients, *[0.0] * degree][: degree + 1]
