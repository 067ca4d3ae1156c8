"""Linkages for tests: four-bars, Peaucellier's linkage and Andrews' squeezer."""

from functools import cache
from typing import Any

import numpy as np

import cgraph as cg
import dynamics as dyn

ACROSS = (0.0, 1.0, 0.0)


def bar(name: str, parent: str, length: float, place: Any, mass: float = 1.0, kind: str = "revolute") -> dyn.Body:
    """A uniform rod along x, on a hinge about y."""
    inertia = mass * length**2 / 12.0
    joint = dyn.Joint(kind, ACROSS, place)
    return dyn.Body(name, joint, parent, mass, (0.5 * length, 0.0, 0.0), (0.0, inertia, inertia))


@cache
def peaucellier() -> dyn.Mechanism:
    """Peaucellier's linkage: long bars of 0.5 m from the world, a rhombus of 0.2 m, and a crank of 0.3 m at 0.3 m."""
    places = {"long 1": "world", "side 1": "long 1", "long 2": "world", "side 2": "long 2"}
    bars = [bar(name, on, 0.5 if on == "world" else 0.2, (0.5 * (on != "world"), 0, 0)) for name, on in places.items()]
    bars += [bar("crank", "world", 0.3, (0.3, 0, 0)), bar("side 3", "crank", 0.2, (0.3, 0, 0))]
    bars.append(bar("side 4", "crank", 0.2, (0.3, 0, 0)))
    ends = [("side 1", "side 2", 0.2), ("side 3", "long 1", 0.5), ("side 4", "long 2", 0.5)]
    loops = [dyn.Loop("point", name, to, at=(0.2, 0, 0), to_at=(end, 0, 0)) for name, to, end in ends]
    return dyn.Mechanism(bars, loops=loops)


@cache
def four_bar(kind: str = "point", length: float = 1.0, mass: float = 1.0) -> dyn.Mechanism:
    """Bars of 0.3, 0.8 and 0.6 of a length on hinges 0.9 apart, closed between the second and the third."""
    crank, coupler, rocker = 0.3 * length, 0.8 * length, 0.6 * length
    bars = [bar("crank", "world", crank, (0, 0, 0), mass), bar("coupler", "crank", coupler, (crank, 0, 0), mass)]
    bars.append(bar("rocker", "world", rocker, (0.9 * length, 0, 0), mass))
    ends: dict[str, Any] = {"at": (coupler, 0, 0), "to_at": (rocker, 0, 0), "axis": ACROSS, "to_axis": ACROSS}
    return dyn.Mechanism(bars, (0.0, 0.0, -9.81 * length), loops=[dyn.Loop(kind, "coupler", "rocker", **ends)])


@cache
def squeezer() -> dyn.Mechanism:
    """Andrews' squeezing mechanism: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section VI.9.

    Coordinates in this order: beta, theta, gamma, delta, phi, epsilon, omega.
    """
    about_z = (0.0, 0.0, 1.0)

    def link(name: str, parent: str, place: Any, mass: float, center: Any, inertia: float) -> dyn.Body:
        joint = dyn.Joint("revolute", about_z, (*place, 0.0))
        return dyn.Body(name, joint, parent, mass, (*center, 0.0), (inertia, inertia, inertia))

    a, b, c = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
    links = [
        link("K1", "world", (0.0, 0.0), 0.04325, (0.00092, 0.0), 2.194e-6),
        link("K2", "K1", (0.007, 0.0), 0.00365, (-0.0115, 0.0), 4.410e-7),
        link("K3", "world", b, 0.02373, (0.01043, -0.01874), 5.255e-6),
        link("K5", "world", a, 0.07050, (0.02308, 0.00916), 1.169e-5),
        link("K4", "K5", (0.04, 0.0), 0.00706, (0.0, 0.01421 - 0.02), 5.667e-7),
        link("K7", "world", a, 0.05498, (0.00449, -0.01228), 1.912e-5),
        link("K6", "K7", (0.0, -0.04), 0.00706, (0.02 - 0.01421, 0.0), 5.667e-7),
    ]
    (gamma,) = cg.variables("q2")
    sine, cosine = cg.sin(gamma), cg.cos(gamma)
    x = 0.02 * cosine + 0.018 * sine + b[0] - c[0]
    y = 0.02 * sine - 0.018 * cosine + b[1] - c[1]
    length = cg.sqrt(x * x + y * y)
    pull = -4530.0 * (length - 0.07785) / length
    spring = dyn.Force("K3", (pull * x, pull * y, 0.0), (0.02, -0.018, 0.0))
    meeting = dyn.Loop("point", "K2", "K3", at=(-0.028, 0, 0), to_at=(0.0, -0.035, 0), name="with K3")
    others = [
        dyn.Loop("point", "K2", "K4", at=(-0.028, 0, 0), to_at=(0.0, -0.02, 0), name="with K4"),
        dyn.Loop("point", "K2", "K6", at=(-0.028, 0, 0), to_at=(0.02, 0.0, 0), name="with K6"),
    ]
    return dyn.Mechanism(links, (0.0, 0.0, 0.0), [spring], loops=[meeting, *others])


def windows(n: int) -> tuple[dyn.Mechanism, list[float], list[float]]:
    """n four-bars in a row, all links of 1 m and 1 kg, with a start: upright, at 1 rad/s."""
    bodies, q, qd = [bar("crank 0", "world", 1.0, (0.0, 0.0, 0.0))], [-0.5 * np.pi], [1.0]
    for k in range(n):
        bodies.append(bar(f"coupler {k}", f"crank {k}", 1.0, (1.0, 0.0, 0.0)))
        bodies.append(bar(f"crank {k + 1}", "world", 1.0, (k + 1.0, 0.0, 0.0)))
        q += [0.5 * np.pi, -0.5 * np.pi]
        qd += [-1.0, 1.0]
    at = {"at": (1.0, 0.0, 0.0), "to_at": (1.0, 0.0, 0.0)}
    loops = [dyn.Loop("point", f"coupler {k}", f"crank {k + 1}", **at) for k in range(n)]
    return dyn.Mechanism(bodies, (0.0, 0.0, -9.81), loops=loops), q, qd
