"""Systems that are not smooth, whose right values are known: what was once found wrong, by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import cgraph as cg
import dynamics as dyn

SLOPE, VALUE = 1e-4, 1e-6  # errors that are right, relative to the largest number
EACH = ("dop853", "dopri5", "radau", "rodas", "rk4")
CHOSEN = EACH[:-1]  # choose their steps


class Member(NamedTuple):
    """What is asked, what is right, and how far off an answer may be."""

    name: str
    ask: Callable[[], Any]
    right: Any
    bound: float = SLOPE


def mass(force: Callable[..., Any], **numbers: float) -> dyn.System:
    """1 kg on a line, under force(x, v, t, p)."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * qd[0] ** 2, ["x"], numbers, lambda q, qd, t, p: [force(q[0], qd[0], t, p)]
    )


def end(model: Any, q: Any, qd: Any, t_end: float, method: str = "dop853", **options: Any) -> list[float]:
    """State at the end."""
    run = dyn.simulate(model, q, qd, t_end, method, max_steps=20_000, progress=False, **options)
    return [*run.q[-1], *run.qd[-1]] if run.stats.success else [math.nan]


def slope(model: Any, loss: Any, q: Any, qd: Any, t_end: float, wrt: Any, method: str, **options: Any) -> list[float]:
    """Gradient of a loss."""
    found = dyn.gradient(model, loss, q, qd, t_end, method, wrt=wrt, **options)
    return [float(each) for name in np.atleast_1d(wrt) for each in np.atleast_1d(found[name])]


def balls(radius: float) -> dyn.Mechanism:
    """Two balls of 1 kg on a line."""
    bodies = [dyn.Body(name, dyn.Joint("prismatic", (1, 0, 0)), mass=1.0) for name in "ab"]
    contact = dyn.Contact("a", "b", radius=radius, to_radius=radius, stiffness=1e6)
    return dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact])


timed = dyn.OdeSystem(lambda x, t, p: [cg.where(cg.less(t, p["T"]), 1.0, 2.0)], ["x"], {"T": 0.7})
turned = dyn.Event("switch", lambda x, t, p: t - p["T"], reset=lambda x, t, p: x)
incline = mass(lambda x, v, t, p: -3.0 - p["mu"] * cg.sign(v), mu=2.0)
bang = mass(lambda x, v, t, p: cg.where(cg.less(t, p["T"]), 1.0, -1.0), T=0.8)
pushed = mass(lambda x, v, t, p: cg.where(cg.less(p["a"], x), -2.0, 0.0), a=0.5)
ramp = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 2.0 * cg.maximum(q[0] - p["a"], 0.0), ["x"], {"a": 0.5})
square = dyn.OdeSystem(lambda x, t, p: [cg.sign(cg.sin(p["w"] * t))], ["x"], {"w": 2.3})
falling = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["g"] * q[0], ["h"], {"g": 9.8})
ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
bounce = dyn.Event("bounce", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.5 * qd[0]]))
parted = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 1.5 * cg.abs(q[0]) ** 2, ["x"])
halves = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - cg.maximum(q[0], 0.0) ** 2 - cg.minimum(q[0], 0.0) ** 2, ["x"])
dropped = dyn.System(lambda q, qd, t: 0.5 * cg.abs(qd[0]) ** 2 - 9.81 * q[0], ["x"])
thrown = dyn.System(lambda q, qd, t: 0.5 * cg.hypot(qd[0], qd[1]) ** 2 - 9.81 * q[1], ["x", "y"])
sinc = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + cg.where(cg.equal(q[0], 0.0), 1.0, cg.sin(q[0]) / q[0]), ["x"])
slowed = mass(lambda x, v, t, p: -2.94 * cg.sign(v))
rubbed = mass(lambda x, v, t, p: -x - 0.3 * cg.sign(v))
struck = mass(lambda x, v, t, p: -x + cg.where(cg.less(cg.abs(t - 50.0), 0.005), 100.0, 0.0))
steady = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"])
gate = dyn.Event("gate", lambda q, qd, t: cg.exp(-(((q[0] - 3.3) / 0.01) ** 2)) - 0.5)


def first(q: Any, *_: Any) -> Any:
    """Loss: the first coordinate."""
    return q[0]


def speed(q: Any, qd: Any, *_: Any) -> Any:
    """Loss: the first velocity."""
    return qd[0]


# Slopes by each method: loss, start, end and by what.
# fmt: off   (tables are read by columns)
SLOPES: tuple[tuple[Any, ...], ...] = (
    ("1a switch in time by T", timed, first, [0.0], None, 2.0, ["T"], [-1.0]),
    ("1a incline by v, mu", incline, first, [0.0], [2.0], 1.0, ["qd", "mu"], [0.52, 0.052]),
    ("1a bang-bang by switch", bang, first, [0.0], [0.0], 2.0, ["T"], [2.4]),
    ("1a force where x > a", pushed, speed, [0.0], [1.0], 1.0, ["q", "qd", "a"], [-2.0, 0.0, 2.0]),
    ("1a the same by a max in L", ramp, speed, [0.0], [1.0], 1.0, ["q", "qd", "a"], [-2.0, 0.0, 2.0]),
    ("1a square wave by w", square, first, [0.0], None, 2.0, ["w"], [-2.0 * math.pi / 2.3**2]),
    ("1b event on a switch by T", timed, first, [0.0], None, 2.0, ["T"], [-1.0], turned),
)
# v = sqrt(g / 2) up, sqrt(2 / g) s after the start, of a ball from 1 m.
SINCE, LATER, UP = 1.0 - math.sqrt(2.0 / 9.8), math.sqrt(0.5 / 9.8**3), math.sqrt(0.5 * 9.8)
BOUNCED = 0.25 * SINCE / UP + UP * LATER - 0.5 * SINCE**2 - 9.8 * SINCE * LATER
OPENS = 0.01 * math.sqrt(math.log(2.0))
OTHERS = (
    Member(
        "1c landing by g",
        lambda: slope(falling, lambda q, qd, t: t, [50.0], [0.0], 9.0, ["g"], "taylor", events=ground),
        -math.sqrt(100.0 / 9.8) / 19.6,
    ),
    Member(
        "1c past a bounce by g",
        lambda: slope(falling, first, [1.0], [0.0], 1.0, ["g"], "taylor", events=bounce),
        BOUNCED,
    ),
    Member("1d linearize abs(x)^2", lambda: dyn.linearize(parted, [0.0], [0.0])[0], [[0.0, 1.0], [-3.0, 0.0]], VALUE),
    Member(
        "1d linearize max^2 + min^2", lambda: dyn.linearize(halves, [0.0], [0.0])[0], [[0.0, 1.0], [-2.0, 0.0]], VALUE
    ),
    Member(
        "1d linearize sin(x)/x", lambda: dyn.linearize(sinc, [0.0], [0.0])[0], [[0.0, 1.0], [-1.0 / 3.0, 0.0]], VALUE
    ),
    Member(
        "1d linearize hypot^2",
        lambda: dyn.linearize(thrown, [0.0, 0.0], [0.0, 0.0])[0][:2],
        [[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        VALUE,
    ),
    Member(
        "1d from rest by hypot^2", lambda: end(thrown, [0.0, 0.0], [0.0, 0.0], 1.0), [0.0, -4.905, 0.0, -9.81], VALUE
    ),
    Member("1d from rest by abs^2", lambda: end(dropped, [0.0], [0.0], 1.0), [-4.905, -9.81], VALUE),
    Member("1e slowed to rest", lambda: end(slowed, [0.0], [10.0], 20.0), [50.0 / 2.94, 0.0], VALUE),
    Member("1e oscillator to rest", lambda: end(rubbed, [1.0], [0.0], 20.0), [-0.2, 0.0], VALUE),
    Member(
        "1e the same, dopri5, rtol=1e-3",
        lambda: end(rubbed, [1.0], [0.0], 20.0, "dopri5", rtol=1e-3),
        [-0.2, 0.0],
        1e-2,
    ),
    Member(
        "1f a pulse of 0.01 s",
        lambda: end(struck, [0.5], [0.0], 60.0)[0],
        0.5 * math.cos(60.0) + 200.0 * math.sin(0.005) * math.sin(10.0),
        VALUE,
    ),
    Member(
        "1h a gate of 0.01",
        lambda: dyn.simulate(steady, [0.0], [1.0], 10.0, events=gate).events["gate"].t,
        [3.3 - OPENS, 3.3 + OPENS],
        VALUE,
    ),
)
# fmt: on


def members() -> Iterator[Member]:
    """All members."""
    for method in EACH:
        more = {} if method in CHOSEN else {"dt": 0.01}
        for name, model, loss, q, qd, t_end, wrt, right, *events in SLOPES:
            ask = partial(slope, model, loss, q, qd, t_end, wrt, method, events=events, **more)
            yield Member(f"{name}, {method}", ask, right)
        yield Member(f"1b past a switch, {method}", partial(end, timed, [0.0], None, 2.0, method, **more), 3.3, VALUE)
        for radius in (0.1, 0.01) if method in CHOSEN else ():
            ask = partial(end, balls(radius), [-1.0, 0.0], [2.0, 0.0], 2.0, method)
            yield Member(f"1g balls of {radius} m, {method}", lambda ask=ask: ask()[2:], [0.0, 2.0], VALUE)
    yield from OTHERS
