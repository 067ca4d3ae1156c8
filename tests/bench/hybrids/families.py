"""Random systems with switching surfaces: each row draws a model in units of its own, and has its exact equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.special import beta

import cgraph as cg
import dynamics as dyn
from tests.bench.hybrids.exact import Exact, solve

DECADES = 6.0  # of the units of length, time and mass, up and down
# Exponents of length, time and mass in the unit of a number, by the first letter of its name.
UNITS = {"m": (0, 0, 1), "k": (0, -2, 1), "d": (0, -1, 1), "x": (1, 0, 0), "v": (1, -1, 0), "F": (1, -2, 1)}
UNITS |= {"T": (0, 1, 0), "w": (0, -1, 0), "g": (1, -2, 0), "e": (0, 0, 0)}
SIGNS: tuple[Callable[[Any, Any], Any], ...] = (  # of a - b, as one may write it
    lambda a, b: cg.sign(a - b),
    lambda a, b: cg.where(cg.less(a, b), -1.0, 1.0),
    lambda a, b: 2.0 * cg.less_equal(b, a) - 1.0,
    lambda a, b: cg.where(cg.less(b, a), 1.0, cg.where(cg.less(a, b), -1.0, 0.0)),
)
FUNCTIONS = {
    name: getattr(cg, name) for name in "abs ceil exp floor fmod less maximum minimum round sign sin tan where".split()
}
FUNCTIONS |= {"pi": Decimal("3.14159265358979323846264338327950288419716939937510582097")}


class Row(NamedTuple):
    """A kind of system, as text with ; between formulas.

    law: rates of x0, x1, .., or where `draws` has a `v` forces on the masses m0, m1, .., with the signs s0, s1, .. of
    the surfaces, a > b for the sign of a - b.  draws: the numbers, start and end.  written: the law without signs.
    potential: the forces' potential in their place.  reset: where x0 falls through 0.
    slopes: whether there are such; None if they are not asked for.
    """

    law: str
    surfaces: str
    draws: str
    written: str = ""
    potential: str = ""
    reset: str = ""
    slopes: bool = True


@dataclass(frozen=True)
class Case:
    """A model in its units, and its motion in plain numbers.

    exact: its equations; where it is None, `right` is the end, and `sizes` are its, or `times` are those of events.
    """

    model: Any
    start: Sequence[float]
    units: Sequence[float]
    t_end: float
    second: float
    numbers: Mapping[str, float] = field(default_factory=dict)
    unit: Mapping[str, float] = field(default_factory=dict)
    exact: Exact | None = None
    events: Sequence[dyn.Event] = ()
    slopes: bool = True
    right: Sequence[float] = ()
    sizes: Sequence[float] = ()
    times: Sequence[float] | None = None


class Draw:
    """Random numbers, and units, from a seed."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.base = [self.power(-DECADES, DECADES) for _ in range(3)]
        self.sign = SIGNS[self.pick(len(SIGNS))]

    def number(self, low: float, high: float) -> float:
        """A number of three digits."""
        return round(float(self.random.uniform(low, high)), 3)

    def power(self, low: float, high: float) -> float:
        """A power of 10 of such an exponent."""
        return float(f"{10 ** self.random.uniform(low, high):.3g}")

    def pick(self, count: int) -> int:
        """A whole number below count."""
        return int(self.random.integers(count))

    def unit(self, name: str) -> float:
        """Unit of a number of this name."""
        return math.prod([base**power for base, power in zip(self.base, UNITS[name[0]], strict=True)])


@cache
def formulas(text: str) -> Callable[[Mapping[str, Any]], list[Any]]:
    """The values of a text's formulas as a function of the names in them."""
    codes = [compile(part.strip(), "a row", "eval") for part in text.split(";") if part.strip()]
    return lambda names: [eval(code, FUNCTIONS, names) for code in codes]


def case(row: Row, u: Draw) -> Case:
    """A draw of a row."""
    drawn: dict[str, Any] = {}
    exec(row.draws, {"u": u.number, "power": u.power, "pick": u.pick, "np": np}, drawn)
    numbers = {name: value for name, value in drawn.items() if name not in ("x", "v", "end") and name[0] != "_"}
    x, v = np.atleast_1d(drawn["x"]).tolist(), np.atleast_1d(drawn.get("v", [])).tolist()
    n, matrix, unit = len(x), drawn.get("_matrix"), {name: u.unit(name) for name in numbers}
    law, written, potential = formulas(row.law), formulas(row.written or row.law), formulas(row.potential)
    surfaces = formulas(row.surfaces.replace(">", ","))

    def names(x: Sequence[Any], t: Any, p: Mapping[str, Any], s: Sequence[Any] = ()) -> dict[str, Any]:
        places = {f"{'xv'[i // n]}{i % n}": each for i, each in enumerate(x)}
        return {**p, "t": t, **places, **{f"s{i}": each for i, each in enumerate(s)}}

    def signed(x: Sequence[Any], t: Any, p: Mapping[str, Any]) -> dict[str, Any]:
        at = names(x, t, p)
        return at if row.written else names(x, t, p, [u.sign(*pair) for pair in surfaces(at)])

    def rate(x: Sequence[Any], t: Any, p: Mapping[str, Any], s: Sequence[Any]) -> list[Any]:
        found = law(names(x, t, p, s))
        if matrix is not None:
            found = list(solve(np.array([[Decimal(a) for a in row] for row in matrix]), np.array(found)[:, None])[:, 0])
        elif v:
            found = [each / p[f"m{i}"] for i, each in enumerate(found)]
        return [*x[n:], *found]

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        masses = np.array(matrix) * u.unit("m") if matrix is not None else np.diag([p[f"m{i}"] for i in range(n)])
        kinetic = sum(
            [masses[i][j] * qd[i] * qd[j] for i in range(n) for j in range(n) if matrix is not None or i == j]
        )
        return kinetic / 2 - sum(potential(names([*q, *qd], t, p)))

    places, scaled = [f"x{i}" for i in range(n)], {name: value * unit[name] for name, value in numbers.items()}
    model: Any
    if v:
        forces = None if row.potential else lambda q, qd, t, p: written(signed([*q, *qd], t, p))
        model = dyn.System(lagrangian, places, scaled, forces)
    else:
        model = dyn.OdeSystem(lambda x, t, p: written(signed(x, t, p)), places, scaled)
    resets, events = (), ()
    if row.reset:
        reset = formulas(row.reset)
        resets = ((lambda x, t, p: x[0], lambda x, t, p: reset(names(x, t, p))),)
        events = (
            dyn.Event(
                "bounce",
                lambda q, qd, t: q[0],
                direction=-1,
                reset=lambda q, qd, t, p: (reset(names([*q, *qd], t, p))[:n], reset(names([*q, *qd], t, p))[n:]),
            ),
        )
    exact = Exact(rate, lambda x, t, p: [a - b for a, b in surfaces(names(x, t, p))], resets)
    units = [u.unit("x")] * n + [u.unit("v")] * len(v)
    return Case(model, [*x, *v], units, drawn["end"], u.unit("T"), numbers, unit, exact, events, row.slopes)


def spheres(u: Draw) -> Case:
    """Two spheres, or one and a wall, that meet and part: Hertz's contact, whose time is a beta function."""
    wall, depth, reach = u.pick(3) == 0, 1.0, 0.0
    while depth > 0.3 * reach:
        m, n, k, radius, further = u.power(-1, 1), u.power(-1, 1), u.power(4, 9), u.power(-3, -0.7), u.power(-3, -0.7)
        v = [u.number(0.5, 8), 0.0 if wall else u.number(-3, 0.4)]
        closing, reduced, reach = v[0] - v[1], m if wall else m * n / (m + n), radius + further * (not wall)
        depth = (1.25 * reduced * closing**2 / k) ** 0.4
    gap = u.number(0.3, 1.5)
    apart = gap / closing + 0.8 * float(beta(0.4, 0.5)) * depth / closing
    t_end = apart + u.number(0.1, 0.9) * gap / closing
    common = 0.0 if wall else (v[0] * m + v[1] * n) / (m + n)  # speed of both together
    after = [2 * common - each for each in v]
    stiffness, length = k * u.unit("F") / u.base[0] ** 1.5, u.base[0]
    # Between touch and parting both move as far as their common speed takes them, and change sides about it.
    x = [-gap - reach, 0.0]
    middle = (x[0] * m + x[1] * n) / (m + n) + common * apart
    parted = [-reach, 0.0] if wall else [middle - reach * n / (m + n), middle + reach * m / (m + n)]
    end = [at + each * (t_end - apart) for at, each in zip(parted, after, strict=True)]
    joint, count = dyn.Joint("prismatic", (1, 0, 0)), 1 if wall else 2
    bodies = [dyn.Body(name, joint, mass=each * u.base[2]) for name, each in (("a", m), ("b", n))][:count]
    to: dict[str, Any] = {"normal": (-1, 0, 0)} if wall else {"to": "b", "to_radius": further * length}
    contact = dyn.Contact("a", radius=radius * length, stiffness=stiffness, **to)
    sizes = [max(abs(a), abs(b), reach) for a, b in zip(x, end, strict=True)][:count]
    sizes += [max(abs(a), abs(b)) for a, b in zip(v, after, strict=True)][:count]
    units = [length] * count + [u.unit("v")] * count
    model, right = dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact]), [*end[:count], *after[:count]]
    return Case(model, [*x[:count], *v[:count]], units, t_end, u.unit("T"), right=right, sizes=sizes)


BLOCK = "m0 = u(.5, 2); k = u(.5, 4); F = u(.5, 3); x = u(-1, 1); v = u(-1, 1); end = u(2, 6); "
PUSHED = "m0 = u(.5, 2); F = u(.5, 3); x = u(-2, -.8); v = u(1, 3); end = u(2, 6); xa = u(-.5, .5); "
BELT = "m0 = u(.5, 2); k = u(.5, 4); F = u(.5, 3); d = u(.05, .3); va = u(.3, 1); x = u(-.5, .5); end = u(3, 15); "
ON_BELT = "-k*x0 - F*s0 + d*(v0 - va)", "v0 > va"
TURNS = range(1, 12)  # of sign(sin(w t))
ROWS: dict[str, tuple[Row | Callable[[Draw], Case], ...]] = {
    "switches in time": (
        Row(
            "(va + vb + s0*(vb - va))/2 - w*x0",
            "t > Ta",
            "x = u(-1, 1); end = u(2, 6); Ta = u(.2, .8)*end; va = u(.5, 3); vb = u(-3, -.5); w = u(.1, 1)",
            "where(less(t, Ta), va, vb) - w*x0",
        ),
        Row(
            "(F*(1 - s0) - Fb*(1 + s1))/2 - k*x0",
            "t > Ta; t > Tb",
            BLOCK + "Fb = u(.5, 3); Ta = u(.2, .8)*end; Tb = Ta if pick(2) else u(.2, .8)*end",
        ),
        Row(
            "F*(1 + " + " + ".join([f"{(-1) ** i}*(1 + s{i - 1})" for i in TURNS]) + ") - k*x0",
            "; ".join([f"t > {i}*pi/w" for i in TURNS]),
            BLOCK + "w = u(1, 30/end)",
            "F*sign(sin(w*t)) - k*x0",
        ),
    ),
    "switches in state": (
        Row("-k*x0 - F*(1 + s0)/2", "x0 > xa", PUSHED + "k = u(.5, 4)"),
        Row("(F - Fb - s0*(F + Fb))/2", "x0 > xa", PUSHED + "Fb = u(.5, 3)", "where(less(x0, xa), F, -Fb)"),
        Row("F*s0 - k*x0", "v0 > w*x0", PUSHED.replace("xa", "_") + "k = u(.5, 4); w = u(.2, 2)"),
    ),
    "friction to rest": (
        Row(
            "-Fb - F*s0",
            "v0 > 0",
            "m0 = u(.5, 2); F = u(.3, 4); Fb = u(.5, 3); x = u(-1, 1); v = u(1, 5); end = v*m0/(F + Fb)*u(1.2, 10)",
        ),
        Row("-k*x0 - F*s0", "v0 > 0", BLOCK + "F = u(.2, 1); x = u(.8, 5); end = u(4, 20)"),
    ),
    "belt": (
        Row(*ON_BELT, BELT + "v = u(-1, .2)"),
        Row(*ON_BELT, BELT + "v = va", slopes=False),  # what starts on a surface has slopes of one side
    ),
    "spheres": (spheres,),
    "pulses": (
        Row(
            "F*(s0 - s1)/2 - k*x0",
            "t > Ta - Tw/2; t > Ta + Tw/2",
            BLOCK + "end = u(3, 12); Tw = power(-6, -.5)*end; F = F/Tw; Ta = u(.3, .8)*end",
            "where(less(abs(t - Ta), Tw/2), F, 0.0) - k*x0",
        ),
    ),
}
FAMILIES = tuple(ROWS)


def draw(family: str, number: int, seed: int) -> Case:
    """A case of a family: its rows in turns."""
    rows = ROWS[family]
    row, u = rows[number % len(rows)], Draw(seed)
    return case(row, u) if isinstance(row, Row) else row(u)
