"""Systems that are not smooth and were once found wrong, by name, with their right values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

import cgraph as cg
import dynamics as dyn
from tests.bench.hybrids.families import PULSE, WAVE, Row

EACH = ("dop853", "dopri5", "radau", "rodas", "rk4")
BLOCK = "m0 = 1.; F = 2.; x = 0.; v = 1.; xa = .5; end = 1."
# A table is read by columns.
# fmt: off
KNOWN = {  # by each method
    "1a switch in time": Row("(3 + s0)/2", "t > Ta", "x = 0.; end = 2.; Ta = .7"),
    "1a incline": Row("-Fb - F*s0", "v0 > 0", "m0 = 1.; F = 2.; Fb = 3.; x = 0.; v = 2.; end = 1."),
    "1a bang-bang": Row("-F*s0", "t > Ta", "m0 = 1.; F = 1.; x = 0.; v = 0.; Ta = .8; end = 2."),
    "1a force where x > a": Row("-F*(1 + s0)/2", "x0 > xa", BLOCK),
    "1a the same by a max in L": Row("-F*(1 + s0)/2", "x0 > xa", BLOCK, potential="F*maximum(x0 - xa, 0.0)"),
    "1a square wave": Row(*WAVE[:2], "m0 = 1.; k = 1e-9; F = 1.; x = 0.; v = 0.; w = 2.3; end = 2.", WAVE[2]),
    "1e slowed to rest": Row("-F*s0", "v0 > 0", "m0 = 1.; F = 2.94; x = 0.; v = 10.; end = 20."),
    "1e oscillator to rest": Row("-k*x0 - F*s0", "v0 > 0", "m0 = 1.; k = 1.; F = .3; x = 1.; v = 0.; end = 20."),
    "1f a pulse": Row(*PULSE[:2], "m0 = 1.; k = 1.; F = 100.; Ta = 50.; Tw = .01; x = .5; v = 0.; end = 60.", PULSE[2]),
}
# fmt: on


def struck(radius: float, method: str) -> Any:
    """Speeds of two balls of 1 kg after one has struck the other at 2 m/s."""
    bodies = [dyn.Body(name, dyn.Joint("prismatic", (1, 0, 0)), mass=1.0) for name in "ab"]
    contact = dyn.Contact("a", "b", radius=radius, to_radius=radius, stiffness=1e6)
    balls = dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact])
    return dyn.simulate(balls, [-1.0, 0.0], [2.0, 0.0], 2.0, method).qd[-1]


def members() -> Iterator[tuple[str, str, Callable[[], Any], Any, float]]:
    """(name, method, what is asked, what is right, how far off it may be, of the largest number) of what takes more."""

    def line(lagrangian: Callable[[Any, Any], Any]) -> dyn.System:
        return dyn.System(lambda q, qd, t: lagrangian(q[0], qd[0]), ["x"])

    timed = dyn.OdeSystem(lambda x, t, p: [cg.where(cg.less(t, p["T"]), 1.0, 2.0)], ["x"], {"T": 0.7})
    turned = dyn.Event("switch", lambda x, t, p: t - p["T"], reset=lambda x, t, p: x)
    for method in EACH:
        ask = partial(dyn.gradient, timed, lambda x, t: x[0], [0.0], None, 2.0, method, wrt="T", events=turned)
        yield "1b event on a jump, by T", method, lambda ask=ask: ask()["T"], -1.0, 1e-6
        for radius in (0.1, 0.01) if method != "rk4" else ():
            yield f"1g balls of {radius} m", method, partial(struck, radius, method), [0.0, 2.0], 1e-6
    ball = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["g"] * q[0], ["x"], {"g": 9.8})
    ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
    landing = partial(dyn.gradient, ball, lambda q, qd, t: t, [50.0], [0.0], 9.0, "taylor", wrt="g", events=ground)
    thrown = dyn.System(lambda q, qd, t: 0.5 * cg.hypot(qd[0], qd[1]) ** 2 - 9.81 * q[1], ["x", "y"])
    at_rest = line(lambda x, v: 0.5 * cg.abs(v) ** 2 - 9.81 * x)
    rubbed = dyn.OdeSystem(lambda x, t: [x[1], -x[0] - 0.3 * cg.sign(x[1])], "x v")
    loose = partial(dyn.simulate, rubbed, [1.0, 0.0], None, 20.0, "dopri5", rtol=1e-3, max_steps=20_000)
    steady, opens = line(lambda x, v: 0.5 * v**2), 0.01 * math.sqrt(math.log(2.0))
    gate = dyn.Event("gate", lambda q, qd, t: cg.exp(-(((q[0] - 3.3) / 0.01) ** 2)) - 0.5)
    through = partial(dyn.simulate, steady, [0.0], [1.0], 10.0, events=gate)
    for name, lagrangian, right in (
        ("abs(x)^2", lambda x, v: 0.5 * v**2 - 1.5 * cg.abs(x) ** 2, -3.0),
        ("max^2 + min^2", lambda x, v: 0.5 * v**2 - cg.maximum(x, 0.0) ** 2 - cg.minimum(x, 0.0) ** 2, -2.0),
        ("sin(x)/x", lambda x, v: 0.5 * v**2 + cg.where(cg.equal(x, 0.0), 1.0, cg.sin(x) / x), -1.0 / 3.0),
    ):
        kinked = partial(dyn.linearize, line(lagrangian), [0.0], [0.0])
        yield f"1d {name}", "linearize", lambda ask=kinked: ask()[0][1][0], right, 1e-6
    # A table is read by columns.
    # fmt: off
    yield from (
        ("1c landing by g", "taylor", lambda: landing()["g"], -math.sqrt(100.0 / 9.8) / 19.6, 1e-6),
        ("1d hypot^2 from rest", "dop853", lambda: dyn.simulate(thrown, [0.0] * 2, [0.0] * 2, 1.0).q[-1], [0.0, -4.905], 1e-6),
        ("1d hypot^2", "linearize", lambda: dyn.linearize(thrown, [0.0] * 2, [0.0] * 2)[0][:2], np.eye(4)[2:], 1e-6),
        ("1d abs^2 from rest", "dop853", lambda: dyn.simulate(at_rest, [0.0], [0.0], 1.0).q[-1], [-4.905], 1e-6),
        ("1e the same by rtol=1e-3", "dopri5", lambda: loose().q[-1], [-0.2, 0.0], 1e-2),
        ("1h a gate of 0.01", "dop853", lambda: through().events["gate"].t, [3.3 - opens, 3.3 + opens], 1e-6),
    )
    # fmt: on
