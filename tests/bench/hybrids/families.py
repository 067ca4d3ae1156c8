"""Random systems with switching surfaces: each row draws a model in units of its own, and has its exact equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
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
    the surfaces, a > b for the sign of a - b.  draws: the numbers, start and end, and the masses as a _matrix.
    written: the law without signs.  potential: in place of forces.  reset: where x0 falls through 0.
    slopes: whether there are such, and asked for.
    """

    law: str
    surfaces: str
    draws: str
    written: str = ""
    potential: str = ""
    reset: str = ""
    slopes: bool = True


class Case(NamedTuple):
    """A model in its units, and its motion in plain numbers.

    numbers, unit: of the model's parameters.  exact: its equations; where it is None, `right` is the end and `sizes`
    those of its states, or `times` are those of events.
    """

    model: Any
    start: Sequence[float]
    units: Sequence[float]
    t_end: float
    second: float
    numbers: Mapping[str, float] = {}
    unit: Mapping[str, float] = {}
    exact: Exact | None = None
    events: Sequence[dyn.Event] = ()
    slopes: bool = True
    right: Sequence[float] = ()
    sizes: Sequence[float] = ()
    times: Sequence[float] | None = None


class Draw:
    """Random numbers, and units, from a seed; the units are 1 without."""

    def __init__(self, seed: int | None = None) -> None:
        self.random = np.random.default_rng(seed)
        self.base = [1.0] * 3 if seed is None else [self.power(-DECADES, DECADES) for _ in range(3)]
        self.sign = SIGNS[self.pick(len(SIGNS)) if seed is not None else 0]

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


def named(x: Sequence[Any], v: Sequence[Any], t: Any, p: Mapping[str, Any]) -> dict[str, Any]:
    """{name: value} of places, speeds, time and numbers."""
    return {**p, "t": t, **{f"x{i}": each for i, each in enumerate(x)}, **{f"v{i}": each for i, each in enumerate(v)}}


def case(row: Row, u: Draw) -> Case:
    """A draw of a row."""
    drawn: dict[str, Any] = {}
    exec(row.draws, {"u": u.number, "power": u.power, "pick": u.pick, "np": np}, drawn)
    numbers = {name: value for name, value in drawn.items() if name not in ("x", "v", "end") and name[0] != "_"}
    x, v = np.atleast_1d(drawn["x"]).tolist(), np.atleast_1d(drawn.get("v", [])).tolist()
    n, unit, resets = len(x), {name: u.unit(name) for name in numbers}, formulas(row.reset)
    law, written, potential, pairs = map(
        formulas, (row.law, row.written, row.potential, row.surfaces.replace(">", ","))
    )
    masses = np.array(drawn.get("_matrix", np.diag([numbers.get(f"m{i}", 1.0) for i in range(n)])))
    given = "_matrix" in drawn
    inverse = solve(np.vectorize(Decimal, "O")(masses), np.eye(n, dtype=int) * Decimal(1)) if given else None

    def forces(x: Any, v: Any, t: Any, p: Any) -> list[Any]:
        at = named(x, v, t, p)
        return written(at) if row.written else law(at | {f"s{i}": u.sign(*pair) for i, pair in enumerate(pairs(at))})

    def rate(x: Any, t: Any, p: Any, s: Any) -> list[Any]:
        found = law(named(x[:n], x[n:], t, p) | {f"s{i}": each for i, each in enumerate(s)})
        if v:
            found = list(inverse @ np.array(found)) if given else [each / p[f"m{i}"] for i, each in enumerate(found)]
        return [*x[n:], *found]

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        inertia = masses * u.unit("m") if given else np.diag([p[f"m{i}"] for i in range(n)])
        kinetic = sum([inertia[i][j] * qd[i] * qd[j] for i, j in np.argwhere(masses)])
        return kinetic / 2 - sum(potential(named(q, qd, t, p)))

    places, scaled = [f"x{i}" for i in range(n)], {name: value * unit[name] for name, value in numbers.items()}
    bounce = dyn.Event(
        "bounce", lambda q, *_: q[0], direction=-1, reset=lambda *at: ((found := resets(named(*at)))[:n], found[n:])
    )
    if v:
        model: Any = dyn.System(lagrangian, places, scaled, None if row.potential else forces)
    else:
        model = dyn.OdeSystem(lambda x, t, p: forces(x, [], t, p), places, scaled)
    exact = Exact(
        rate,
        lambda x, t, p: [a - b for a, b in pairs(named(x[:n], x[n:], t, p))],
        (lambda x, t, p: resets(named(x[:n], x[n:], t, p))) if row.reset else None,
    )
    units, events = [u.unit("x")] * n + [u.unit("v")] * len(v), (bounce,) * bool(row.reset)
    return Case(model, [*x, *v], units, drawn["end"], u.unit("T"), numbers, unit, exact, events, row.slopes)


def spheres(u: Draw) -> Case:
    """Two spheres, or one and a wall, that meet and part: Hertz's contact, whose time is a beta function."""
    wall, depth, reach = u.pick(3) == 0, 1.0, 0.0
    while depth > 0.3 * reach:
        m, n, k, radius, further = u.power(-1, 1), u.power(-1, 1), u.power(4, 9), u.power(-3, -0.7), u.power(-3, -0.7)
        m, n, further = (m, math.inf, 0.0) if wall else (m, n, further)
        v = [u.number(0.5, 8), 0.0 if wall else u.number(-3, 0.4)]
        closing, share, reach = v[0] - v[1], 1.0 / (1.0 + m / n), radius + further  # of the first in what they move
        depth = (1.25 * m * share * closing**2 / k) ** 0.4
    gap = u.number(0.3, 1.5)
    apart = (gap + 0.8 * float(beta(0.4, 0.5)) * depth) / closing
    x, t_end, common = [-gap - reach, 0.0], apart + u.number(0.1, 0.9) * gap / closing, v[1] + closing * (1.0 - share)
    # Between touch and parting both move as far as their common speed takes them, and change sides about it.
    middle = x[1] * share + x[0] * (1.0 - share) + common * apart
    after = [2.0 * common - each for each in v]
    parted = middle - reach * share, middle + reach * (1.0 - share)
    end = [at + each * (t_end - apart) for at, each in zip(parted, after, strict=True)]
    count, length, joint = 1 if wall else 2, u.base[0], dyn.Joint("prismatic", (1, 0, 0))
    bodies = [dyn.Body(name, joint, mass=each * u.base[2]) for name, each in (("a", m), ("b", n))[:count]]
    to: dict[str, Any] = {"normal": (-1, 0, 0)} if wall else {"to": "b", "to_radius": further * length}
    contact = dyn.Contact("a", radius=radius * length, stiffness=k * u.unit("F") / length**1.5, **to)
    model, right = dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact]), [*end[:count], *after[:count]]
    start, units = [*x[:count], *v[:count]], [length] * count + [u.unit("v")] * count
    sizes = np.maximum(np.abs([start, right]).max(axis=0), [reach] * count + [0.0] * count)
    return Case(model, start, units, t_end, u.unit("T"), right=right, sizes=sizes.tolist())


def passing(u: Draw, value: str, zeros: str) -> Case:
    """The instants at which a quantity is 0, where x0 is one of `zeros`, in free flight or an oscillation."""
    swings = u.pick(2)
    near = True
    while near:
        numbers = {"xa": u.number(-0.8, 0.8), "xb": u.power(-6, -0.5), "xc": u.number(0.15, 0.5)}
        levels, speed = np.array(formulas(zeros)(numbers)), 0.0 if swings else u.number(0.3, 2)
        start, end = (1.0, u.number(1, 8)) if swings else (-1.5, 3.0 / speed)
        if swings:  # x = cos(t)
            half = np.arccos(levels[np.abs(levels) < 1.0])
            times = np.sort(
                [2.0 * math.pi * turn + way * each for each in half for way in (1, -1) for turn in range(3)]
            )
        else:
            times = np.sort((levels - start) / speed)
        near = (np.minimum(np.abs(times), np.abs(times - end)) < 1e-3 * end).any()
        near |= bool(swings) and bool((np.abs(np.abs(levels) - 1.0) < 1e-2).any())
    quantity, lengths = formulas(value), {name: each * u.unit("x") for name, each in numbers.items()}
    stiffness = u.unit("k") * swings
    model = dyn.System(lambda q, qd, t: (u.unit("m") * qd[0] ** 2 - stiffness * q[0] ** 2) / 2, ["x0"])
    event = dyn.Event("passing", lambda q, qd, t: quantity({**lengths, "x0": q[0]})[0])
    inside = times[(times > 0.0) & (times < end)].tolist()
    return Case(model, [start, speed], [u.unit("x"), u.unit("v")], end, u.unit("T"), events=[event], times=inside)


def joints(u: Draw) -> Case:
    """Joints with dry friction, independent or coupled by their masses, that come to rest one after another."""
    n, each = 2 + u.pick(19), "u(-1, 1)"
    masses = "; ".join([f"m{i} = u(.5, 2)" for i in range(n)])
    coupled = f"_a = np.array([{each} for _ in range({n * n})]).reshape({n}, {n}); "
    coupled += f"_matrix = (np.eye({n}) + _a @ _a.T/{n}).round(3)"
    draws = [f"F{i} = u(.2, 2)" for i in range(n)] + [f"x = [{each} for _ in range({n})]"]
    draws += [f"v = [3*{each} for _ in range({n})]", "end = u(3, 20)", coupled if u.pick(2) else masses]
    law, surfaces = [f"-F{i}*s{i}" for i in range(n)], [f"v{i} > 0" for i in range(n)]
    return case(Row("; ".join(law), "; ".join(surfaces), "; ".join(draws), slopes=False), u)


def floor(start: int) -> str:
    """Text of a floor, of the signs of the levels from start + 1 on."""
    return f"({start} + " + " + ".join([f"(1 + s{i})/2" for i in range(LEVELS)]) + ")"


def levels(formula: str, start: int) -> str:
    """Text of the surfaces of that floor."""
    return "; ".join([formula.format(n=start + 1 + i) for i in range(LEVELS)])


LEVELS = 12  # steps of a floor
BLOCK = "m0 = u(.5, 2); k = u(.5, 4); F = u(.5, 3); x = u(-1, 1); v = u(-1, 1); end = u(2, 6); "
PUSHED = "m0 = u(.5, 2); F = u(.5, 3); x = u(-2, -.8); v = u(1, 3); end = u(2, 6); xa = u(-.5, .5); "
BELT = "m0 = u(.5, 2); k = u(.5, 4); F = u(.5, 3); d = u(.05, .3); va = u(.3, 1); x = u(-.5, .5); end = u(3, 15); "
STACK = "m0 = u(.5, 2); m1 = u(.5, 2); ea = u(.05, .6); eb = u(.05, .6); g = u(1, 10); end = u(.5, 4); "
STACK += "x = [u(-1, 1), u(-1, 1)]; v = [u(-3, 3), u(-3, 3)]; "
RELAY = "vb = u(.5, 3); x = u(.2, 2); end = u(2, 6); "
SAW = "x = u(-1, 1); Ta = u(.2, .8); end = u(2, 11)*Ta; va = u(-2, 2); "
STAIR = "xa = u(.5, 1); x = u(-2, 2); vb = u(.2, 1); va = u(-3, 3)*vb; end = u(2, 8); "
BALL = "m0 = u(.5, 2); Fb = u(1, 5); e = u(.4, .9); x = u(.5, 2); v = u(-1, 2); end = u(1, 4)*np.sqrt(2*x*m0/Fb); "
PAIR = "m0 = u(.5, 2); F = u(.5, 3); Fb = u(.5, 3); _t = u(.3, 1); end = u(2, 5); "
ON_BELT = "-k*x0 - F*s0 + d*(v0 - va)", "v0 > va"
TURNS = range(1, 12)  # of sign(sin(w t))
# fmt: off   (a table is read by columns)
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
    "stacks": (
        Row("-ea*g*(m0 + m1)*s0 + eb*g*m1*s1; -eb*g*m1*s1", "v0 > 0; v1 > v0", STACK),
        Row(
            "-ea*g*(m0 + m1)*s0 + eb*g*m1*s1; F - eb*g*m1*s1",
            "v0 > 0; v1 > v0",
            STACK + "F = u(0, 1.2)*eb*g*m1; v = [0, 0]",
            slopes=False,
        ),  # pulled from rest
        Row(
            "-ea*g*(m0 + m1 + m2)*s0 + eb*g*(m1 + m2)*s1; -eb*g*(m1 + m2)*s1 + ec*g*m2*s2; -ec*g*m2*s2",
            "v0 > 0; v1 > v0; v2 > v1",
            STACK + "m2 = u(.5, 2); ec = u(.05, .6); x += [u(-1, 1)]; v += [u(-3, 3)]",
        ),
    ),
    "relays": (
        Row("va - vb*s0", "x0 > 0", RELAY + "va = u(-.9, .9)*vb"),
        Row("va + g*t - vb*s0", "x0 > 0", RELAY + "va = u(-.9, 0)*vb; g = u(.2, 1.5)"),
        Row("-F*s0 - k*x0", "x0 > -Ta*v0", BLOCK + "Ta = u(.3, 2)"),
        Row(
            "w*x1 - va*s0; -w*x0 - vb*s1",
            "x0 > 0; x1 > 0",
            RELAY + "va = u(.5, 3); w = u(.2, 2); x = [u(-2, 2), u(-2, 2)]",
        ),
    ),
    "floors and saws": (
        Row("va + vb*" + floor(0), levels("t > {n}*Ta", 0), SAW + "vb = u(-1, 1)", "va + vb*floor(t/Ta)"),
        Row("va + g*(t - Ta*" + floor(0) + ")", levels("t > {n}*Ta", 0), SAW + "g = u(1, 5)", "va + g*fmod(t, Ta)"),
        Row("va - vb*" + floor(-7), levels("x0 > {n}*xa", -7), STAIR, "va - vb*floor(x0/xa)"),
        Row("va - vb*(1 + " + floor(-7) + ")", levels("x0 > {n}*xa", -7), STAIR, "va - vb*ceil(x0/xa)"),
        Row("-k*xa*" + floor(-6), levels("x0 > (2*{n} - 1)*xa/2", -6), BLOCK + "xa = u(.5, 1)", "-k*xa*round(x0/xa)"),
        Row(
            "va - w*(x0 - xa*" + floor(0) + ")",
            levels("x0 > {n}*xa", 0),
            "xa = u(.5, 1); w = u(.5, 2); va = u(1.1, 2)*w*xa; x = u(.1, .9)*xa; end = u(1, 9)*xa/va",
            "va - w*fmod(x0, xa)",
        ),
    ),
    "bounces": (
        Row("-Fb - F*s0", "v0 > 0", BALL + "F = u(.1, .8)*Fb", reset="x0; -e*v0"),
        Row("-Fb - d*v0", "", BALL + "d = u(.1, 1)", reset="x0; -e*v0"),
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
    "gates": (
        lambda u: passing(u, "exp(-((x0 - xa)/xb)**2) - 0.5", "xa - 0.8325546111576977*xb; xa + 0.8325546111576977*xb"),
    ),
    "two at an instant": (
        Row(
            "-F*(1 + s0)/2; -Fb*(1 + s1)/2",
            "x0 > xa; x1 > xb",
            PAIR
            + "m1 = u(.5, 2); x = [u(-1, 0), u(-1, 0)]; v = [u(1, 3), u(1, 3)]; xa = x[0] + v[0]*_t; xb = x[1] + v[1]*_t",
        ),
        Row(
            "-F*(1 + s0)/2 - Fb*(1 + s1)/2",
            "x0 > xa; t > Ta",
            PAIR + "x = u(-1, 0); v = u(1, 3); xa = x + v*_t; Ta = _t",
        ),
        Row(
            "-F*s0; -Fb*s1",
            "v0 > 0; v1 > 0",
            PAIR
            + "Fb = F*u(.8, 1.2); _c = u(-.5, .5); _matrix = [[u(1, 2), _c], [_c, u(1, 2)]]; x = [u(-1, 1), u(-1, 1)]; "
            "v = (np.linalg.solve(_matrix, [F, Fb])*_t).tolist(); del m0",
            slopes=False,
        ),
    ),
    "joints to rest": (joints,),
    "kinks": (
        Row(
            "va - w*s0*(x0 - xa)",
            "x0 > xa",
            "x = u(-1, 1); xa = u(-1, 1); w = u(.2, 1); va = u(-2, 2); end = u(1, 4)",
            "va - w*abs(x0 - xa)",
        ),
        Row(
            "-k*(x0 - xa)*(1 + s0)/2 - kb*(x0 + xb)*(1 - s1)/2",
            "x0 > xa; x0 > -xb",
            BLOCK + "del F; v = u(1, 3); xa = u(.1, .9); xb = u(.1, .9); kb = k*power(-1, 2)",
            "-k*maximum(x0 - xa, 0.0) - kb*minimum(x0 + xb, 0.0)",
        ),
        Row("-F*(1 + s0)/2", "x0 > xa", PUSHED, potential="F*maximum(x0 - xa, 0.0)"),
        Row(
            "-k*(x0 + xa - s0*(x0 - xa))/2",
            "x0 > xa",
            BLOCK + "del F; v = u(1, 3); xa = u(.1, .9)",
            "-k*minimum(x0, xa)",
        ),
    ),
    "poles": (
        lambda u: passing(u, "xc/(x0 - xa)", ""),
        lambda u: passing(u, "xc/(x0 - xa) + 1", "xa - xc"),
        lambda u: passing(u, "tan(x0/xc)", "; ".join([f"{n}*{math.pi}*xc" for n in range(-9, 10)])),
    ),
}
# fmt: on
FAMILIES = tuple(ROWS)


def draw(family: str, number: int, seed: int) -> Case:
    """A case of a family: its rows in turns."""
    rows = ROWS[family]
    row, u = rows[number % len(rows)], Draw(seed)
    return case(row, u) if isinstance(row, Row) else row(u)
