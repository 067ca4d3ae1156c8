"""Random systems with switching surfaces: each row draws a model in units of its own, and has its exact equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy.special import beta

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from tests.bench.hybrids.exact import Exact, PoorDrawError, solution

DECADES = 6.0  # of the units of length, time and mass, up and down
GROWTH = 300.0  # times which an error of the start may have grown at the end
TINY = 1e-8  # of numbers in units of 1, what is rounding
LOOSE = 1e-3  # error by equal steps, which are longer than a contact, of which a run says nothing
# Exponents of length, time and mass in the unit of a number, by the first letter of its name.
UNITS = {"m": (0, 0, 1), "k": (0, -2, 1), "d": (0, -1, 1), "x": (1, 0, 0), "v": (1, -1, 0), "F": (1, -2, 1)}
UNITS |= {"T": (0, 1, 0), "w": (0, -1, 0), "g": (1, -2, 0), "e": (0, 0, 0)}
SIGNS: tuple[Callable[[Any, Any], Any], ...] = (  # of a - b, as one may write it
    lambda a, b: cg.sign(a - b),
    lambda a, b: cg.where(cg.less(a, b), -1.0, 1.0),
    lambda a, b: 2.0 * cg.less_equal(b, a) - 1.0,
    lambda a, b: cg.where(cg.less(b, a), 1.0, cg.where(cg.less(a, b), -1.0, 0.0)),
)
NAMES = "abs ceil exp floor fmod less maximum minimum round sign sin tan where"
FUNCTIONS = {"pi": math.pi} | {name: getattr(cg, name) for name in NAMES.split()}


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
    """A model and a run of it, with what is right, in units of 1: the end, or where `timed` shares of t_end of events.

    start: q and qd, or x.  slopes: by the start and ln of `numbers`, or None.  equal: error of equal steps that is right.
    """

    model: Any
    start: Sequence[Array]
    t_end: float
    units: Array
    right: Array
    sizes: Any = 1.0
    slopes: Array | None = None
    numbers: Mapping[str, float] = {}
    events: Sequence[dyn.Event] = ()
    timed: bool = False
    equal: float = 1e-5


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


def case(row: Row, u: Draw) -> Case:
    """A draw of a row.  Raises PoorDrawError for one that cannot be judged."""
    drawn: dict[str, Any] = {}
    exec(row.draws, {"u": u.number, "power": u.power, "pick": u.pick, "np": np}, drawn)
    numbers = {name: value for name, value in drawn.items() if name not in ("x", "v", "end") and name[0] != "_"}
    start = np.hstack([drawn["x"], drawn.get("v", [])])
    n, scaled = np.size(drawn["x"]), {name: value * u.unit(name) for name, value in numbers.items()}
    law, written, potential, resets = map(formulas, (row.law, row.written, row.potential, row.reset))
    pairs, second_order = formulas(row.surfaces.replace(">", ",")), len(start) > n
    places, speeds = [f"x{i}" for i in range(n)], [f"v{i}" for i in range(n)]
    masses = np.array(drawn.get("_matrix", np.diag([numbers.get(f"m{i}", 1.0) for i in range(n)])))
    given, inverse = "_matrix" in drawn, np.linalg.inv(masses)

    def named(x: Sequence[Any], v: Sequence[Any], t: Any, p: Mapping[str, Any]) -> dict[str, Any]:
        return {**p, "t": t, **dict(zip(places, x, strict=True)), **dict(zip(speeds, v, strict=False))}

    def forces(x: Any, v: Any, t: Any, p: Any) -> list[Any]:
        at = named(x, v, t, p)
        return written(at) if row.written else law(at | {f"s{i}": u.sign(*pair) for i, pair in enumerate(pairs(at))})

    def rate(x: Any, t: Any, p: Any, s: Any) -> list[Any]:
        found = law(named(x[:n], x[n:], t, p) | {f"s{i}": each for i, each in enumerate(s)})
        if second_order:
            found = list(inverse @ np.array(found)) if given else [each / p[f"m{i}"] for i, each in enumerate(found)]
        return [*x[n:], *found]

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        inertia = masses * u.unit("m") if given else np.diag([p[f"m{i}"] for i in range(n)])
        kinetic = sum([inertia[i][j] * qd[i] * qd[j] for i, j in np.argwhere(masses)])
        return kinetic / 2 - sum(potential(named(q, qd, t, p)))

    def bounced(q: Any, qd: Any, t: Any, p: Any) -> tuple[Any, Any]:
        return (found := resets(named(q, qd, t, p)))[:n], found[n:]

    def surfaces(x: Any, t: Any, p: Any) -> list[Any]:
        return [a - b for a, b in pairs(named(x[:n], x[n:], t, p))]

    units = np.array([u.unit("x")] * n + [u.unit("v")] * (len(start) - n))
    if second_order:
        model: Any = dyn.System(lagrangian, places, scaled, None if row.potential else forces)
    else:
        model = dyn.OdeSystem(lambda x, t, p: forces(x, [], t, p), places, scaled)
    events = [dyn.Event("bounce", lambda q, *_: q[0], direction=-1, reset=bounced)] * bool(row.reset)
    exact = Exact(rate, surfaces, (lambda x, t, p: resets(named(x[:n], x[n:], t, p))) if row.reset else None)
    end, sizes, slopes = solution(exact, start, numbers, drawn["end"], row.slopes)
    sizes = np.where(sizes > TINY, sizes, 1.0)
    if slopes is not None and np.abs(slopes).max() > GROWTH * sizes.max():
        raise PoorDrawError
    at = [part for part in np.split(start * units, [n]) if part.size]
    return Case(model, at, drawn["end"] * u.unit("T"), units, end, sizes, slopes, scaled, events)


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
    model, right = dyn.Mechanism(bodies, gravity=(0, 0, 0), forces=[contact]), np.array([*end[:count], *after[:count]])
    start, units = np.array([*x[:count], *v[:count]]), np.repeat([length, u.unit("v")], count)
    sizes = np.maximum(np.abs([start, right]).max(axis=0), np.repeat([reach, 0.0], count))
    return Case(model, np.split(start * units, 2), t_end * u.unit("T"), units, right, sizes, equal=LOOSE)


def passing(u: Draw, value: str, zeros: str) -> Case:
    """The instants at which a quantity is 0, where x0 is one of `zeros`, in free flight or an oscillation."""
    swings, numbers = u.pick(2), {"xa": u.number(-0.8, 0.8), "xb": u.power(-6, -0.5), "xc": u.number(0.15, 0.5)}
    levels, speed = np.array(formulas(zeros)(numbers)), 0.0 if swings else u.number(0.3, 2)
    start, end = (1.0, u.number(1, 8)) if swings else (-1.5, 3.0 / speed)
    if swings:  # x = cos(t)
        half = np.arccos(levels[np.abs(levels) < 1.0])
        times = np.hstack([2.0 * math.pi * turn + way * half for way in (1, -1) for turn in range(3)])
    else:
        times = (levels - start) / speed
    grazes = swings and (np.abs(np.abs(levels) - 1.0) < 1e-2).any()
    if grazes or (np.minimum(np.abs(times), np.abs(times - end)) < 1e-3 * end).any():
        raise PoorDrawError
    quantity, lengths = formulas(value), {name: each * u.unit("x") for name, each in numbers.items()}
    model = dyn.System(lambda q, qd, t: (u.unit("m") * qd[0] ** 2 - swings * u.unit("k") * q[0] ** 2) / 2, ["x0"])
    event = dyn.Event("passing", lambda q, qd, t: quantity({**lengths, "x0": q[0]})[0])
    units = np.array([u.unit("x"), u.unit("v")])
    inside = np.sort(times[(times > 0.0) & (times < end)]) / end
    at = np.split(np.array([start, speed]) * units, 2)
    return Case(model, at, end * u.unit("T"), units, inside, events=[event], timed=True)


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
PULSE = "F*(s0 - s1)/2 - k*x0", "t > Ta - Tw/2; t > Ta + Tw/2", "where(less(abs(t - Ta), Tw/2), F, 0.0) - k*x0"
TURNS = range(1, 12)  # of sign(sin(w t))
SQUARE = "F*(1 + " + " + ".join([f"{(-1) ** i}*(1 + s{i - 1})" for i in TURNS]) + ") - k*x0"
WAVE = SQUARE, "; ".join([f"t > {i}*pi/w" for i in TURNS]), "F*sign(sin(w*t)) - k*x0"
# A table is read by columns.
# fmt: off
ROWS: tuple[tuple[str, Row | Callable[[Draw], Case]], ...] = (
    ("switches in time", Row("(va + vb + s0*(vb - va))/2 - w*x0", "t > Ta",
        "x = u(-1, 1); end = u(2, 6); Ta = u(.2, .8)*end; va = u(.5, 3); vb = u(-3, -.5); w = u(.1, 1)",
        "where(less(t, Ta), va, vb) - w*x0")),
    ("switches in time", Row("(F*(1 - s0) - Fb*(1 + s1))/2 - k*x0", "t > Ta; t > Tb",
        BLOCK + "Fb = u(.5, 3); Ta = u(.2, .8)*end; Tb = Ta if pick(2) else u(.2, .8)*end")),
    ("switches in time", Row(*WAVE[:2], BLOCK + "w = u(1, 30/end)", WAVE[2])),
    ("switches in state", Row("-k*x0 - F*(1 + s0)/2", "x0 > xa", PUSHED + "k = u(.5, 4)")),
    ("switches in state", Row("(F - Fb - s0*(F + Fb))/2", "x0 > xa", PUSHED + "Fb = u(.5, 3)",
        "where(less(x0, xa), F, -Fb)")),
    ("switches in state", Row("F*s0 - k*x0", "v0 > w*x0", PUSHED.replace("xa", "_") + "k = u(.5, 4); w = u(.2, 2)")),
    ("friction to rest", Row("-Fb - F*s0", "v0 > 0",
        "m0 = u(.5, 2); F = u(.3, 4); Fb = u(.5, 3); x = u(-1, 1); v = u(1, 5); end = v*m0/(F + Fb)*u(1.2, 10)")),
    ("friction to rest", Row("-k*x0 - F*s0", "v0 > 0", BLOCK + "F = u(.2, 1); x = u(.8, 5); end = u(4, 20)")),
    ("belt", Row(*ON_BELT, BELT + "v = u(-1, .2)")),
    ("belt", Row(*ON_BELT, BELT + "v = va", slopes=False)),  # what starts on a surface has slopes of one side
    ("stacks", Row("-ea*g*(m0 + m1)*s0 + eb*g*m1*s1; -eb*g*m1*s1", "v0 > 0; v1 > v0", STACK)),
    ("stacks", Row("-ea*g*(m0 + m1)*s0 + eb*g*m1*s1; F - eb*g*m1*s1", "v0 > 0; v1 > v0",
        STACK + "F = u(0, 1.2)*eb*g*m1; v = [0, 0]", slopes=False)),  # pulled from rest
    ("stacks", Row("-ea*g*(m0 + m1 + m2)*s0 + eb*g*(m1 + m2)*s1; -eb*g*(m1 + m2)*s1 + ec*g*m2*s2; -ec*g*m2*s2",
        "v0 > 0; v1 > v0; v2 > v1", STACK + "m2 = u(.5, 2); ec = u(.05, .6); x += [u(-1, 1)]; v += [u(-3, 3)]")),
    ("relays", Row("va - vb*s0", "x0 > 0", RELAY + "va = u(-.9, .9)*vb")),
    ("relays", Row("va + g*t - vb*s0", "x0 > 0", RELAY + "va = u(-.9, 0)*vb; g = u(.2, 1.5)")),
    ("relays", Row("-F*s0 - k*x0", "x0 > -Ta*v0", BLOCK + "Ta = u(.3, 2)")),
    ("relays", Row("w*x1 - va*s0; -w*x0 - vb*s1", "x0 > 0; x1 > 0",
        RELAY + "va = u(.5, 3); w = u(.2, 2); x = [u(-2, 2), u(-2, 2)]")),
    ("floors and saws", Row("va + vb*" + floor(0), levels("t > {n}*Ta", 0), SAW + "vb = u(-1, 1)",
        "va + vb*floor(t/Ta)")),
    ("floors and saws", Row("va + g*(t - Ta*" + floor(0) + ")", levels("t > {n}*Ta", 0), SAW + "g = u(1, 5)",
        "va + g*fmod(t, Ta)")),
    ("floors and saws", Row("va - vb*" + floor(-7), levels("x0 > {n}*xa", -7), STAIR, "va - vb*floor(x0/xa)")),
    ("floors and saws", Row("va - vb*(1 + " + floor(-7) + ")", levels("x0 > {n}*xa", -7), STAIR,
        "va - vb*ceil(x0/xa)")),
    ("floors and saws", Row("-k*xa*" + floor(-6), levels("x0 > (2*{n} - 1)*xa/2", -6), BLOCK + "xa = u(.5, 1)",
        "-k*xa*round(x0/xa)")),
    ("floors and saws", Row("va - w*(x0 - xa*" + floor(0) + ")", levels("x0 > {n}*xa", 0),
        "xa = u(.5, 1); w = u(.5, 2); va = u(1.1, 2)*w*xa; x = u(.1, .9)*xa; end = u(1, 9)*xa/va",
        "va - w*fmod(x0, xa)")),
    ("bounces", Row("-Fb - F*s0", "v0 > 0", BALL + "F = u(.1, .8)*Fb", reset="x0; -e*v0")),
    ("bounces", Row("-Fb - d*v0", "", BALL + "d = u(.1, 1)", reset="x0; -e*v0")),
    ("spheres", spheres),
    ("pulses", Row(*PULSE[:2],
        BLOCK + "end = u(3, 12); Tw = power(-6, -.5)*end; F = F/Tw; Ta = u(.3, .8)*end", PULSE[2])),
    ("gates", lambda u: passing(u, "exp(-((x0 - xa)/xb)**2) - 0.5",
        "xa - 0.8325546111576977*xb; xa + 0.8325546111576977*xb")),
    ("two at an instant", Row("-F*(1 + s0)/2; -Fb*(1 + s1)/2", "x0 > xa; x1 > xb",
        PAIR + "m1 = u(.5, 2); x = [u(-1, 0), u(-1, 0)]; v = [u(1, 3), u(1, 3)]; xa = x[0] + v[0]*_t; xb = x[1] + v[1]*_t")),
    ("two at an instant", Row("-F*(1 + s0)/2 - Fb*(1 + s1)/2", "x0 > xa; t > Ta",
        PAIR + "x = u(-1, 0); v = u(1, 3); xa = x + v*_t; Ta = _t")),
    ("two at an instant", Row("-F*s0; -Fb*s1", "v0 > 0; v1 > 0",
        PAIR + "Fb = F*u(.8, 1.2); _c = u(-.5, .5); _matrix = [[u(1, 2), _c], [_c, u(1, 2)]]; x = [u(-1, 1), u(-1, 1)]; "
        "v = (np.linalg.solve(_matrix, [F, Fb])*_t).tolist(); del m0", slopes=False)),
    ("joints to rest", joints),
    ("kinks", Row("va - w*s0*(x0 - xa)", "x0 > xa",
        "x = u(-1, 1); xa = u(-1, 1); w = u(.2, 1); va = u(-2, 2); end = u(1, 4)", "va - w*abs(x0 - xa)")),
    ("kinks", Row("-k*(x0 - xa)*(1 + s0)/2 - kb*(x0 + xb)*(1 - s1)/2", "x0 > xa; x0 > -xb",
        BLOCK + "del F; v = u(1, 3); xa = u(.1, .9); xb = u(.1, .9); kb = k*power(-1, 2)",
        "-k*maximum(x0 - xa, 0.0) - kb*minimum(x0 + xb, 0.0)")),
    ("kinks", Row("-F*(1 + s0)/2", "x0 > xa", PUSHED, potential="F*maximum(x0 - xa, 0.0)")),
    ("kinks", Row("-k*(x0 + xa - s0*(x0 - xa))/2", "x0 > xa", BLOCK + "del F; v = u(1, 3); xa = u(.1, .9)",
        "-k*minimum(x0, xa)")),
    ("poles", lambda u: passing(u, "xc/(x0 - xa)", "")),
    ("poles", lambda u: passing(u, "xc/(x0 - xa) + 1", "xa - xc")),
    ("poles", lambda u: passing(u, "tan(x0/xc)", "; ".join([f"{n}*{math.pi}*xc" for n in range(-9, 10)]))),
)
# fmt: on
FAMILIES = tuple(dict.fromkeys([family for family, _ in ROWS]))


def drawn(seed: int) -> Case:
    """The case of a seed: the first draw of a row that can be judged, rows of a family in turns."""
    family = FAMILIES[seed % len(FAMILIES)]
    rows = [row for name, row in ROWS if name == family]
    row = rows[seed // len(FAMILIES) % len(rows)]
    for again in range(1000):
        u = Draw(1000 * seed + again)
        with suppress(PoorDrawError):
            return case(row, u) if isinstance(row, Row) else row(u)
    raise RuntimeError(f"no draw of {family} with seed {seed} can be judged")
