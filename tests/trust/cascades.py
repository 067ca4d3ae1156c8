"""Cascades: equal balls that meet, rest on one another and hit walls at one instant, judged by exact fractions.

Equal balls on a line that swap their velocities are points that pass through one another: where they are is where
free points are, in order; and between walls, where points on a line are that is folded. Nothing of this needs to know
what happens first.
"""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from cgraph import Node
from cgraph._shared import Array
from dynamics.integrators import METHODS
from dynamics.simulation.ensembles.simulate_many import simulate_many
from dynamics.simulation.events.event import Event
from dynamics.simulation.simulate import simulate
from dynamics.systems.system import System
from tests.bench.tables import Table
from tests.trust.trust import COUNT, RIGHT, SAID, SILENT, SLACK, Verdict, counted, trust

CASCADES = 100
UNITS = 6.0  # decades of the units of length and time, each way
STEPS = 40  # of equal ones
GRID = 4  # places in a unit of length, so that much happens at once
TOLERANCE = 1e-9  # relative, of chosen steps by default
KINDS = ("cradle", "meeting", "walls", "corner")


@dataclass(frozen=True)
class Balls:
    """Equal balls on a line, or the coordinates of one in a box, with contacts and walls as events.

    x, v: at the start.  size: of a ball.  walls: where the centers of the first and the last ball turn back; empty
    without.  pull: the acceleration of all, of balls without walls.  order: of the events.
    """

    name: str
    x: tuple[float, ...]
    v: tuple[float, ...]
    size: float
    walls: tuple[float, ...]
    pull: float
    alone: bool  # coordinates of one ball, each between the walls
    t_end: float
    order: tuple[int, ...]
    direction: int

    @property
    def system(self) -> System:
        """Free motion, or one under a common pull."""
        pull = self.pull
        return System(
            lambda q, qd, t: sum(0.5 * qd[i] ** 2 + pull * q[i] for i in range(len(q))),
            [f"x{i}" for i in range(len(self.x))],
        )

    @property
    def events(self) -> list[Event]:
        """Contacts and walls."""
        n, size = len(self.x), self.size
        contacts = [] if self.alone else [_contact(i, size, self.direction) for i in range(n - 1)]
        walls = [
            _wall(i, wall, side)
            for wall, side, outer in zip(self.walls, (1.0, -1.0), (0, n - 1), strict=False)
            for i in (range(n) if self.alone else [outer])
        ]
        every = [*contacts, *walls]
        return [every[k] for k in self.order]

    def end(self) -> tuple[list[Fraction], list[Fraction]]:
        """Places and velocities at t_end."""
        t, pull, size = Fraction(self.t_end), Fraction(self.pull), Fraction(self.size)
        shifts = [Fraction(0) if self.alone else i * size for i in range(len(self.x))]
        states = [
            (Fraction(x) - shift + Fraction(v) * t + pull * t * t / 2, Fraction(v) + pull * t)
            for x, v, shift in zip(self.x, self.v, shifts, strict=True)
        ]
        if self.walls:
            low, high = (Fraction(wall) for wall in self.walls)
            states = [_folded(x, v, low, high - shifts[-1]) for x, v in states]
        if not self.alone:
            states.sort()
        return [x + shift for (x, _), shift in zip(states, shifts, strict=True)], [v for _, v in states]


def _contact(i: int, size: float, direction: int) -> Event:
    def swapped(q: Sequence[Node], qd: Sequence[Node], t: Node) -> tuple[Sequence[Node], list[Node]]:
        return q, [*qd[:i], qd[i + 1], qd[i], *qd[i + 2 :]]

    return Event(f"contact {i}", lambda q, qd, t: q[i + 1] - q[i] - size, direction, reset=swapped)


def _wall(i: int, place: float, side: float) -> Event:
    def turned(q: Sequence[Node], qd: Sequence[Node], t: Node) -> tuple[Sequence[Node], list[Node]]:
        return q, [-v if k == i else v for k, v in enumerate(qd)]

    return Event(f"wall {i} {side:g}", lambda q, qd, t: side * (q[i] - place), -1, reset=turned)


def _folded(x: Fraction, v: Fraction, low: Fraction, high: Fraction) -> tuple[Fraction, Fraction]:
    """State of a point on a line that is folded at both walls."""
    times, inside = divmod(x - low, high - low)
    return (low + inside, v) if times % 2 == 0 else (high - inside, -v)


def random_balls(number: int) -> Balls:
    """The cascade of this number."""
    rng = np.random.default_rng([number, 3313])
    kind = KINDS[number % len(KINDS)]
    n = int(rng.integers(2, 4 if kind == "corner" else 6))
    length, second = 10.0 ** rng.uniform(-UNITS, UNITS, 2)
    size = 0.0 if kind == "corner" else float(rng.integers(0, 3)) / GRID
    speeds = rng.integers(-3, 4, n).astype(float)
    walls: Array = np.empty(0)
    if kind == "meeting":  # all but one at one place after one second
        spread = np.sort(rng.permutation(np.arange(-6, 7))[:n])[::-1] / 2.0
        speeds = spread + float(rng.integers(-1, 2))
        x = size * np.arange(n) - speeds
        speeds[rng.integers(n)] += float(rng.integers(0, 2))
    else:
        gaps = rng.integers(1, 5, n) * (rng.random(n) < 0.4) / GRID
        x = np.cumsum(gaps) + size * np.arange(n)
        if kind == "cradle":  # some balls rest on one another, and those from the left come to hit them
            speeds = np.where(np.arange(n) == 0, float(rng.integers(1, 4)), float(rng.integers(-2, 1)))
            x[0] -= 1.0
        else:
            walls = np.array([0.0, x[-1] + float(rng.integers(1, 5)) / GRID])
        if kind == "corner":  # as many steps of the grid from a wall as the speed is large
            speeds = rng.choice([-1.0, 1.0], n) * float(rng.integers(1, 4))
            x = np.where(speeds < 0.0, 1.0, walls[-1] + 1.0)
            walls[-1] += 2.0
    alone = kind == "corner"
    count = 2 * n if alone else n - 1 + len(walls)
    gaps = np.diff(x) - size
    touching = (gaps == 0.0) & (np.diff(speeds) != 0.0)
    return Balls(
        f"{kind} {number // len(KINDS)}",
        tuple((x * length).tolist()),
        tuple((speeds * length / second).tolist()),
        size * length,
        tuple((walls * length).tolist()),
        0.0 if len(walls) else float(rng.choice([0.0, 1.0]) * rng.normal() * length / second**2),
        alone,
        float(rng.uniform(2.0, 5.0) * second),
        tuple(rng.permutation(count).tolist()),
        -1 if touching.any() else int(rng.choice([-1, 0])),
    )


def judge_balls(number: int, method: str | None = None, *, many: bool = False) -> Verdict:
    """The verdict on one cascade by a method, in `simulate` or `simulate_many`, with default arguments but for dt."""
    balls = random_balls(number)
    if method in METHODS and METHODS[method].order == 1:  # which is not exact under a pull
        balls = replace(balls, pull=0.0)
    arguments: dict[str, Any] = {"events": balls.events, "progress": False}
    if method is not None:
        arguments["method"] = method
        if method in METHODS and not METHODS[method].adaptive:
            arguments |= {"dt": balls.t_end / STEPS, "estimate_error": False}
    with warnings.catch_warnings(record=True, action="always") as caught:
        if many:
            runs = simulate_many(balls.system, [balls.x], [balls.v], balls.t_end, t_eval=[balls.t_end], **arguments)
            q, qd, success, message = runs.q[0, -1], runs.qd[0, -1], runs.stats.success[0], runs.stats.message[0]
            steps, seconds = int(runs.stats.steps[0]), runs.stats.seconds
        else:
            run = simulate(balls.system, balls.x, balls.v, balls.t_end, **arguments)
            q, qd, success, message = run.q[-1], run.qd[-1], run.stats.success, run.stats.message
            steps, seconds = run.stats.steps, run.stats.seconds
    words = "; ".join([*([] if success else [message]), *[str(each.message) for each in caught]])
    excess = _error(balls, q, qd) / TOLERANCE if success else math.nan
    verdict = RIGHT if excess <= SLACK else SAID if words else SILENT
    return Verdict(balls.name, method or "default", verdict, excess, words, steps, seconds)


def _error(balls: Balls, q: Array, qd: Array) -> float:
    """The largest at t_end, of places relative to how far the balls came, of velocities to the fastest."""
    x, v = balls.end()
    fastest = max(*[abs(float(one)) for one in v], *[abs(one) for one in balls.v])
    far = max(*[abs(one) for one in balls.x], fastest * balls.t_end)
    pairs = zip((x, v), (q, qd), (far, fastest), strict=True)
    return max(
        abs(float(one - Fraction(float(number)))) / (scale or 1.0)
        for exact, numbers, scale in pairs
        for one, number in zip(exact, numbers, strict=True)
    )


def cascades(count: int = CASCADES) -> Iterator[Table | str]:
    """The verdicts on so many cascades by all methods, and in words those that are not right."""
    judged = [judge_balls(number, method) for method in (None, *METHODS) for number in range(count)]
    title = f"{count} cascades of 2 to 5 equal balls, by exact fractions; excess: error over {TOLERANCE:g}"
    yield from counted(title, judged, {"largest excess": lambda chosen, ends: f"{max(ends, default=math.nan):.2g}"})


def with_cascades(count: int = COUNT) -> Iterator[Table | str]:
    """The verdicts of `trust`, and those on cascades."""
    yield from trust(count)
    yield from cascades(min(count, CASCADES))
