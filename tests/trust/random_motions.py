"""Random motions, drawn from a seed: Lagrangians of eight families; starts at 0, chains, and forces that jump."""

import math
from collections.abc import Callable, Sequence

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.systems.ode_system import OdeSystem
from dynamics.systems.system import System

Lagrangian = Callable[[list[Node], list[Node], Node], Node]
Maker = Callable[[np.random.Generator, str], AccuracyTask]
FAMILIES: dict[str, Maker] = {}
LAGRANGIANS = 200
FREQUENCY = 3.0  # rad/s, of what turns with time


def random_task(number: int) -> AccuracyTask:
    """The random Lagrangian of this number, the families in turn; the same number gives the same system."""
    names = tuple(FAMILIES)
    family = names[number % len(names)]
    return FAMILIES[family](np.random.default_rng([number, 20251]), f"{family} {number // len(names)}")


def family(make: Maker) -> Maker:
    """Adds a family under the name of its function."""
    FAMILIES[make.__name__.replace("_", " ")] = make
    return make


@family
def potential(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Constant masses in a potential of cosines, squares and fourth powers."""
    n = _size(rng)
    mass, well = _masses(rng, n), _potential(rng, n)
    return _task(name, lambda q, qd, t: _kinetic(mass, qd) - well(q), *_start(rng, n))


@family
def curved(rng: np.random.Generator, name: str) -> AccuracyTask:
    """A mass matrix that depends on q, A + sum_k w_k w_k^T (1 + sin(k . q)) / 2, in a potential."""
    n = _size(rng)
    return _task(name, _curved(rng, n), *_start(rng, n))


@family
def time_dependent(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Masses and forces that swing with time, some with damping."""
    n = _size(rng)
    still, push, swing = _curved(rng, n), rng.normal(size=n), rng.uniform(0.0, 0.5)
    frequency, phase = rng.uniform(0.3, FREQUENCY, size=2), rng.uniform(0.0, 2 * math.pi)

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        force = _dot(push, q) * cg.sin(frequency[0] * t + phase)
        total: Node = (1.0 + swing * cg.cos(frequency[1] * t)) * still(q, qd, t) + force
        return total

    return _task(name, lagrangian, *_start(rng, n), damping=float(rng.choice([0.0, 0.1])))


@family
def magnetic(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Terms linear in the velocities, A(q, t) . qd: fields that bend the motion without work."""
    n = 2 + _size(rng) % 2
    still, field, waves = _curved(rng, n), 2.0 * rng.normal(size=(n, n)), rng.normal(size=(n, n))
    frequency = rng.uniform(0.3, FREQUENCY)

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        turns = [_dot(field[i], q) + cg.sin(_dot(waves[i], q) + frequency * t) for i in range(n)]
        total: Node = still(q, qd, t) + _sum([a * v for a, v in zip(turns, qd, strict=True)])
        return total

    return _task(name, lagrangian, *_start(rng, n))


@family
def relativistic(rng: np.random.Generator, name: str) -> AccuracyTask:
    """-m c^2 sqrt(1 - v^2 / c^2) in a potential, at a tenth to 99 hundredths of c."""
    n = _size(rng)
    well, c, mass = _potential(rng, n), 10.0 ** rng.uniform(0.0, 2.0), rng.uniform(0.3, 3.0)
    direction, share = rng.normal(size=n), rng.choice([0.1, 0.5, 0.9, 0.99])
    speed = c * share * direction / np.linalg.norm(direction)

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        total: Node = -mass * c**2 * cg.sqrt(1.0 - _sum([v * v for v in qd]) / c**2) - well(q)
        return total

    return _task(name, lagrangian, rng.uniform(-1.0, 1.0, size=n), speed, rng.uniform(1.0, 3.0))


@family
def stiff(rng: np.random.Generator, name: str) -> AccuracyTask:
    """A spring of 1e4 to 1e10 N/m with as much damping beside slow motions."""
    n = 1 + _size(rng)
    slow = _curved(rng, n - 1) if n > 1 else None
    rate = 10.0 ** rng.uniform(2.0, 5.0)  # 1/s
    q, qd, t_end = _start(rng, n)

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        fast = 0.5 * qd[0] ** 2 - 0.5 * rate**2 * (q[0] - 0.3 * cg.cos(q[1])) ** 2
        total: Node = fast + (0.0 if slow is None else slow(q[1:], qd[1:], t))
        return total

    q[0], qd[0] = 0.3 * math.cos(q[1]) + rng.choice([0.0, 0.01]), 0.0
    damping = [2.0 * rate, *[0.05] * (n - 1)]
    return _task(name, lagrangian, q, qd, t_end, damping=damping, stiff=True)


@family
def singular(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Orbits about a center that pulls with 1/r^k or log r; and motions that end: falls, escapes, a mass that ends."""
    power, strength, far = rng.choice([0.0, 0.5, 1.0, 2.0]), rng.uniform(0.5, 2.0), rng.uniform(0.5, 2.0)
    kind = rng.choice(["orbit", "orbit", "fall", "escape", "mass"])
    t_end = rng.uniform(4.0, 10.0)

    def pull(q: list[Node], qd: list[Node], t: Node) -> Node:
        square = _sum([x * x for x in q])
        return _kinetic(np.eye(len(q)), qd) + (
            -0.5 * strength * cg.log(square) if power == 0.0 else strength / square ** (0.5 * power)
        )

    if kind == "orbit":
        angle, speed = rng.uniform(0.0, 2 * math.pi), rng.uniform(0.2, 1.0) * math.sqrt(strength / far**power)
        along, aside = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        return _task(name, pull, far * along, speed * aside, t_end)
    n = int(rng.integers(1, 3))
    q, qd = far * np.eye(n)[0], np.zeros(n)
    if kind == "fall":
        return _task(name, pull, q, qd, t_end)
    if kind == "escape":  # to infinity, in a time of about 1.9 / (far sqrt(strength))
        return _task(name, lambda q, qd, t: _kinetic(np.eye(n), qd) + 0.25 * strength * q[0] ** 4, q, qd, t_end)
    return _task(
        name,
        lambda q, qd, t: 0.5 * _sum([(x * v) ** 2 for x, v in zip(q, qd, strict=True)]) - strength * q[0],
        q + 0.1,
        qd,
        t_end,
    )


@family
def small_or_large(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Curved systems in other units of length, mass and time, by powers of ten up to nine."""
    n = _size(rng)
    still, (q, qd, t_end) = _curved(rng, n), _start(rng, n)
    length, mass, second = (10.0 ** rng.integers(-9, 10, size=3)).tolist()

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        unit = mass * length**2 / second**2
        total: Node = unit * still([x / length for x in q], [v * (second / length) for v in qd], t / second)
        return total

    return _task(name, lagrangian, q * length, qd * (length / second), t_end * second)


def _size(rng: np.random.Generator) -> int:
    return int(rng.integers(1, 4))


def _start(rng: np.random.Generator, n: int) -> tuple[Array, Array, float]:
    """q, qd and t_end; one start in three is at rest."""
    qd = rng.normal(size=n) if rng.random() < 2 / 3 else np.zeros(n)
    return rng.uniform(-2.0, 2.0, size=n), qd, float(rng.uniform(1.0, 10.0))


def _masses(rng: np.random.Generator, n: int) -> Array:
    """A positive definite matrix whose condition is up to about a thousand."""
    basis = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return np.asarray(basis @ np.diag(10.0 ** rng.uniform(-1.5, 1.5, size=n)) @ basis.T)


def _potential(rng: np.random.Generator, n: int) -> Callable[[list[Node]], Node]:
    waves, phases, heights = rng.normal(size=(n + 1, n)), rng.uniform(0.0, 6.0, size=n + 1), rng.normal(size=n + 1)
    squares, fourths = rng.uniform(0.0, 3.0, size=n), rng.uniform(0.0, 0.5, size=n)

    def energy(q: list[Node]) -> Node:
        ripples = [h * cg.cos(_dot(k, q) + a) for h, k, a in zip(heights, waves, phases, strict=True)]
        return _sum(ripples) + _sum([a * x**2 + b * x**4 for a, b, x in zip(squares, fourths, q, strict=True)])

    return energy


def _curved(rng: np.random.Generator, n: int) -> Lagrangian:
    mass, well = _masses(rng, n), _potential(rng, n)
    rows, waves = rng.normal(size=(2, n)), rng.normal(size=(2, n))

    def lagrangian(q: list[Node], qd: list[Node], t: Node) -> Node:
        bends = [_dot(w, qd) ** 2 * (0.25 + 0.25 * cg.sin(_dot(k, q))) for w, k in zip(rows, waves, strict=True)]
        return _kinetic(mass, qd) + _sum(bends) - well(q)

    return lagrangian


def _kinetic(mass: Array, qd: Sequence[Node]) -> Node:
    return 0.5 * _sum([v * _dot(row, qd) for v, row in zip(qd, mass, strict=True)])


def _dot(numbers: Array, nodes: Sequence[Node]) -> Node:
    return _sum([float(number) * node for number, node in zip(numbers, nodes, strict=True)])


def _sum(nodes: Sequence[Node]) -> Node:
    total = nodes[0]
    for node in nodes[1:]:
        total = total + node
    return total


def _task(
    name: str,
    lagrangian: Lagrangian,
    q: Array,
    qd: Array,
    t_end: float,
    damping: float | list[float] = 0.0,
    stiff: bool = False,
) -> AccuracyTask:
    model = System(lagrangian, [f"x{i}" for i in range(len(q))], damping=damping)
    start = tuple(q.tolist()), tuple(qd.tolist())
    return AccuracyTask(name, "a random Lagrangian", model, *start, float(t_end), stiff=stiff, series=not stiff)


EACH = 100  # of every family
UNITS = 6.0  # decades of the units of length and time, each way
Push = Callable[[Node], Node]


def random_motion(number: int) -> AccuracyTask:
    """The random Lagrangian of this number, and from the last of them on the random starts, the families in turn."""
    if number < LAGRANGIANS:
        return random_task(number)
    make = STARTS[number % len(STARTS)]
    name = f"{make.__name__.replace('_', ' ')} {(number - LAGRANGIANS) // len(STARTS)}"
    return make(np.random.default_rng([number, 24061]), name)


def from_rest(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Motion from rest at 0, under forces that begin at 0 and grow."""
    power = float(rng.integers(1, 5))
    pushes: list[Push] = [
        lambda t: cg.sin(3.0 * t),
        lambda t: t**power,
        lambda t: 1.0 - cg.cos(2.0 * t),
        lambda t: t * cg.exp(-t),
        lambda t: t / (1.0 + t),
        lambda t: 40.0 * t,
    ]
    return _driven(rng, name, pushes[rng.integers(len(pushes))], moving=False)


def jump(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Forces that jump, or have a kink, at one instant or at several; from rest or on the way."""
    first, second = np.sort(rng.uniform(0.1, 2.5, 2)).tolist()
    pushes: list[Push] = [
        lambda t: cg.where(t > first, 1.0, 0.0),
        lambda t: cg.where(t > first, 1.0, -0.5) + cg.where(t > second, 30.0, 0.0),
        lambda t: cg.maximum(t - first, 0.0),
        lambda t: abs(t - first) + cg.where(t > second, t, 0.0),
        lambda t: cg.where(t > first, cg.where(t > second, 0.0, 1.0), 0.0) / (second - first),
    ]
    return _driven(rng, name, pushes[rng.integers(len(pushes))], moving=bool(rng.integers(2)))


def chain(rng: np.random.Generator, name: str) -> AccuracyTask:
    """Substances that turn into one another, the first alone at the start; some need two that meet."""
    n, second, amount = int(rng.integers(3, 13)), _unit(rng), _unit(rng)
    rates = rng.uniform(0.3, 3.0, (2, n)) / second
    meets = rng.random(n) < 0.3

    def rate(x: Sequence[Node], t: Node) -> list[Node]:
        flows = [rates[0, k] * x[k] * (x[0] / amount if meets[k] and k else 1.0) for k in range(n - 1)]
        back = [rates[1, k] * x[k + 1] * 0.3 for k in range(n - 1)]
        none = cg.constant(0.0)
        net = [none, *[a - b for a, b in zip(flows, back, strict=True)], none]
        return [net[k] - net[k + 1] for k in range(n)]

    model = OdeSystem(rate, [f"x{k}" for k in range(n)])
    start = (amount, *[0.0] * (n - 1))
    return AccuracyTask(name, "a chain of reactions", model, start, (), float(rng.uniform(2.0, 6.0) * second))


STARTS = (from_rest, jump, chain)


def _driven(rng: np.random.Generator, name: str, push: Push, *, moving: bool) -> AccuracyTask:
    """One to three coordinates, some of them pushed, coupled by their inertia and by springs."""
    n, length, second = int(rng.integers(1, 4)), _unit(rng), _unit(rng)
    mass = np.eye(n) + 0.3 * np.ones((n, n))
    stiffness, turning = rng.uniform(-1.0, 5.0, n), rng.uniform(0.0, 0.4)
    strength = rng.uniform(0.3, 2.0, n) * (np.arange(n) == rng.integers(n)).astype(float)
    gain, energy = rng.choice([0.0, 20.0]), (length / second) ** 2.0

    def lagrangian(q: Sequence[Node], qd: Sequence[Node], t: Node) -> Node:
        x, v = [each / length for each in q], [each * (second / length) for each in qd]
        pairs = [(i, j) for i in range(n) for j in range(n)]
        kinetic = sum([0.5 * mass[i, j] * v[i] * v[j] for i, j in pairs], cg.constant(0.0))
        kinetic = kinetic * (1.0 + turning * cg.sin(x[-1]))
        springs = [0.5 * stiffness[i] * x[i] ** 2.0 + 0.5 * (x[i] - x[i - 1]) ** 2.0 for i in range(n)]
        total: Node = energy * (kinetic - sum(springs, cg.constant(0.0)))
        return total

    def forces(q: Sequence[Node], qd: Sequence[Node], t: Node) -> list[Node | float]:
        return [float(s) * energy / length * push(t / second) for s in strength]

    damping = float(gain * 0.2 * energy * second / length**2)
    model = System(lagrangian, [f"x{i}" for i in range(n)], forces=forces, damping=damping)
    q, qd = (rng.normal(size=(2, n)) if moving else np.zeros((2, n))).tolist()
    start = tuple([length * x for x in q]), tuple([length / second * x for x in qd])
    return AccuracyTask(name, "driven", model, *start, float(rng.uniform(2.6, 4.0) * second))


def _unit(rng: np.random.Generator) -> float:
    """A unit, a power of two; 1 as often as not."""
    return float(2.0 ** round(rng.uniform(-UNITS, UNITS) / math.log10(2.0))) if rng.integers(2) else 1.0
