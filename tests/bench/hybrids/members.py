"""Systems that are not smooth and were once found wrong, by name, with their right values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
import dynamics as dyn
from tests.bench.hybrids.families import ROWS, Row

EACH = ("dop853", "dopri5", "radau", "rodas", "rk4")
SQUARE = ROWS["switches in time"][2]
assert isinstance(SQUARE, Row)
# fmt: off   (a table is read by columns)
KNOWN = {  # by each method
    "1a switch in time": Row("(3 + s0)/2", "t > Ta", "x = 0.; end = 2.; Ta = .7"),
    "1a incline": Row("-Fb - F*s0", "v0 > 0", "m0 = 1.; F = 2.; Fb = 3.; x = 0.; v = 2.; end = 1."),
    "1a bang-bang": Row("-F*s0", "t > Ta", "m0 = 1.; F = 1.; x = 0.; v = 0.; Ta = .8; end = 2."),
    "1a force where x > a": Row("-F*(1 + s0)/2", "x0 > xa", "m0 = 1.; F = 2.; x = 0.; v = 1.; xa = .5; end = 1."),
    "1a the same by a max in L": Row(
        "-F*(1 + s0)/2",
        "x0 > xa",
        "m0 = 1.; F = 2.; x = 0.; v = 1.; xa = .5; end = 1.",
        potential="F*maximum(x0 - xa, 0.0)",
    ),
    "1a square wave": SQUARE._replace(draws="m0 = 1.; k = 1e-9; F = 1.; x = 0.; v = 0.; w = 2.3; end = 2."),
    "1e slowed to rest": Row("-F*s0", "v0 > 0", "m0 = 1.; F = 2.94; x = 0.; v = 10.; end = 20."),
    "1e oscillator to rest": Row("-k*x0 - F*s0", "v0 > 0", "m0 = 1.; k = 1.; F = .3; x = 1.; v = 0.; end = 20."),
    "1f a pulse": Row(
        "F*(s0 - s1)/2 - k*x0",
        "t > Ta - Tw/2; t > Ta + Tw/2",
        "m0 = 1.; k = 1.; F = 100.; Ta = 50.; Tw = .01; x = .5; v = 0.; end = 60.",
        "where(less(abs(t - Ta), Tw/2), F, 0.0) - k*x0",
    ),
}
# fmt: on


class Member(NamedTuple):
    """What is asked of a method, what is right, and how far off an answer may be, relative to the largest number."""

    name: str
    method: str
    ask: Callable[[], Any]
    right: Any
    bound: float = 1e-6


def line(lagrangian: Callable[..., Any], **numbers: float) -> dyn.System:
    """A system of one coordinate."""
    return dyn.System(lambda q, qd, t, p: lagrangian(q[0], qd[0], p), ["x"], numbers)


def slope(model: Any, loss: Any, q: Any, qd: Any, t_end: float, wrt: str, method: str, **options: Any) -> float:
    """Gradient of a loss by one number."""
    return float(dyn.gradient(model, loss, q, qd, t_end, method, wrt=wrt, **options)[wrt])


def struck(radius: float, method: str) -> Any:
    """Speeds of two balls of 1 kg after one has struck the other at 2 m/s."""
    bodies = [dyn.Body(name, dyn.Joint("prismatic", (1, 0, 0)), mass=1.0) for name in "ab"]
    contact = dyn.Contact("a", "b", radius=radius, to_radius=radius, stiffness=1e6)
    balls = dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact])
    return dyn.simulate(balls, [-1.0, 0.0], [2.0, 0.0], 2.0, method).qd[-1]


def members() -> Iterator[Member]:
    """The members that take more than a row."""
    timed = dyn.OdeSystem(lambda x, t, p: [cg.where(cg.less(t, p["T"]), 1.0, 2.0)], ["x"], {"T": 0.7})
    turned = dyn.Event("switch", lambda x, t, p: t - p["T"], reset=lambda x, t, p: x)
    for method in EACH:
        ask = partial(slope, timed, lambda x, t: x[0], [0.0], None, 2.0, "T", method, events=turned)
        yield Member("1b event on a jump, by T", method, ask, -1.0)
        for radius in (0.1, 0.01) if method != "rk4" else ():
            yield Member(f"1g balls of {radius} m", method, partial(struck, radius, method), [0.0, 2.0])
    ball = line(lambda x, v, p: 0.5 * v**2 - p["g"] * x, g=9.8)
    ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
    ask = partial(slope, ball, lambda q, qd, t: t, [50.0], [0.0], 9.0, "g", "taylor", events=ground)
    yield Member("1c landing by g", "taylor", ask, -math.sqrt(100.0 / 9.8) / 19.6)
    for name, model, right in (
        ("abs(x)^2", line(lambda x, v, p: 0.5 * v**2 - 1.5 * cg.abs(x) ** 2), -3.0),
        ("max^2 + min^2", line(lambda x, v, p: 0.5 * v**2 - cg.maximum(x, 0.0) ** 2 - cg.minimum(x, 0.0) ** 2), -2.0),
        ("sin(x)/x", line(lambda x, v, p: 0.5 * v**2 + cg.where(cg.equal(x, 0.0), 1.0, cg.sin(x) / x)), -1.0 / 3.0),
    ):
        yield Member(f"1d {name}", "linearize", lambda m=model: dyn.linearize(m, [0.0], [0.0])[0][1][0], right)
    thrown = dyn.System(lambda q, qd, t: 0.5 * cg.hypot(qd[0], qd[1]) ** 2 - 9.81 * q[1], ["x", "y"])
    yield Member(
        "1d hypot^2 from rest", "dop853", lambda: dyn.simulate(thrown, [0.0] * 2, [0.0] * 2, 1.0).q[-1], [0.0, -4.905]
    )
    yield Member("1d hypot^2", "linearize", lambda: dyn.linearize(thrown, [0.0] * 2, [0.0] * 2)[0][:2], np.eye(4)[2:])
    at_rest = line(lambda x, v, p: 0.5 * cg.abs(v) ** 2 - 9.81 * x)
    yield Member("1d abs^2 from rest", "dop853", lambda: dyn.simulate(at_rest, [0.0], [0.0], 1.0).q[-1], -4.905)
    rubbed = dyn.OdeSystem(lambda x, t: [x[1], -x[0] - 0.3 * cg.sign(x[1])], "x v")
    loose = partial(dyn.simulate, rubbed, [1.0, 0.0], None, 20.0, "dopri5", rtol=1e-3, max_steps=20_000)
    yield Member("1e the same by rtol=1e-3", "dopri5", lambda: loose().q[-1], [-0.2, 0.0], 1e-2)
    steady, opens = line(lambda x, v, p: 0.5 * v**2), 0.01 * math.sqrt(math.log(2.0))
    gate = dyn.Event("gate", lambda q, qd, t: cg.exp(-(((q[0] - 3.3) / 0.01) ** 2)) - 0.5)
    ask = partial(dyn.simulate, steady, [0.0], [1.0], 10.0, events=gate)
    yield Member("1h a gate of 0.01", "dop853", lambda: ask().events["gate"].t, [3.3 - opens, 3.3 + opens])
