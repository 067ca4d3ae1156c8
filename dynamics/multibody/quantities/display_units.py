"""Units of the inputs and outputs of a mechanism's graphs, as a person reads them."""

from __future__ import annotations

from collections.abc import Sequence

from ..body import Body

_FORCES = {"rad/s": "N m", "m/s": "N"}


def display_units(bodies: Sequence[Body]) -> dict[str, str]:
    """{name in a graph: unit} of moving bodies: "1" of the entries of a quaternion, "N m" of a torque."""
    units: dict[str, str] = {}
    types = [body.joint.type for body in bodies]
    for i, unit in enumerate([each for kind in types for each in kind.units]):
        rate = "1/s" if unit == "1" else f"{unit}/s"
        units |= {f"q{i}": unit, f"q{i}_old": unit, f"q{i}_dot": rate}
    for i, unit in enumerate([each for kind in types for each in kind.velocity_units]):
        acceleration, force = unit.replace("/s", "/s\u00b2"), _FORCES[unit]
        units |= {f"qd{i}": unit, f"qd{i}_old": unit, f"qd{i}_dot": acceleration, f"qdd{i}": acceleration}
        units |= {f"{kind}{i}": force for kind in ("tau", "bias", "gravity")}
        units |= {f"p{i}": f"{force} s", f"p{i}_dot": force}
    return units
