"""The cases of the stability table: equations against a form written by hand, invariants, and solutions."""

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pytest import approx, mark, param

import dynamics as dyn
from dynamics.equations.state_equation import state_equation, state_inputs
from dynamics.experiments.accuracy_task import StabilityCase
from dynamics.experiments.stability import cases
from dynamics.experiments.stability.cases import chains, rotation
from dynamics.multiprecision import Reference, reference
from tests import high_precision
from tests.dynamics.linkage_by_numpy import placed
from tests.dynamics.models import Array, split_state
from tests.dynamics.tree_in_digits import tree_in_digits
from tests.each_row import each_row
from tests.oracles import closed_forms
from tests.slow import slow

Rate = Callable[[Array, float], Any]  # of the state and t, written without the library
Closed = Callable[[Sequence[float]], Reference]  # of the times

STATES = 4
ROUNDING = 1e-12  # of the largest term
LAST_BITS = 1e-15  # of numbers about 1
LARGE = 200  # states; a larger model is measured in the benchmarks, and its family is tested at a hundred links


def spring_pendulum(k: float, c: float) -> Rate:
    def rate(x: Array, t: float) -> list[float]:
        s, a, u, w = x
        return [u, w, (1 + s) * w * w + 9.81 * math.cos(a) - k * s - c * u,
                -(2 * u * w + 9.81 * math.sin(a)) / (1 + s)]  # fmt: skip

    return rate


def van_der_pol(mu: float) -> Rate:
    return lambda x, t: [x[1], mu**2 * ((1 - x[0] ** 2) * x[1] - x[0])]


def robertson(x: Array, t: float) -> list[float]:
    slow, fast, middle = 0.04 * x[0], 3e7 * x[1] ** 2, 1e4 * x[1] * x[2]
    return [middle - slow, slow - middle - fast, fast]


def bodies(
    masses: Sequence[float],
    lengths: Sequence[float],
    gravity: float = 9.81,
    center: Sequence[float] | None = None,
    inertia: Sequence[float] | None = None,
    armature: float = 0.0,
) -> Rate:
    """A planar chain in sixty digits. Rods unless centers and inertias are given."""
    n = len(masses)
    c = [each / 2 for each in lengths] if center is None else center
    moment = [m * b * b / 12 for m, b in zip(masses, lengths, strict=True)] if inertia is None else inertia
    links = []
    for i in range(n):
        place = (0.0, 0.0, -lengths[i - 1] if i else 0.0)
        joint = dyn.Joint("revolute", (0.0, 1.0, 0.0), place, armature=armature)
        parent, at = f"{i - 1}" if i else "world", (0.0, 0.0, -c[i])
        links.append(dyn.Body(f"{i}", joint, parent, masses[i], at, (moment[i], moment[i], 0.0)))
    return in_digits(dyn.Mechanism(links, (0.0, 0.0, -gravity)))


def in_digits(tree: dyn.Mechanism) -> Rate:
    n, none = len(tree.bodies), np.zeros(len(tree.bodies))
    return lambda x, t: [*x[n:], *tree_in_digits(tree, x[:n], x[n:], none, none)["accelerations"]]


def on_three_hinges(inertia: Sequence[float], pull: float = 0.0) -> dyn.Mechanism:
    """A body that turns in Euler angles; its weight, which is large, pulls next to the point that it turns about."""
    hinges = [dyn.Joint("revolute", axis) for axis in ((0, 0, 1), (1, 0, 0), (0, 0, 1))]
    carriers = [dyn.Body("precession", hinges[0]), dyn.Body("tilt", hinges[1], "precession")]
    center = 2.0**-30
    body = dyn.Body("body", hinges[2], "tilt", 1.0, (0.0, 0.0, center), inertia)
    return dyn.Mechanism([*carriers, body], (0.0, 0.0, -pull / center))


def kapitza(x: Array, t: float) -> list[float]:
    lift = -0.05 * 150.0**2 * math.cos(150.0 * t)  # the pivot's acceleration upwards
    return [x[1], -(9.81 + lift) * math.sin(x[0])]


LET_GO = ("at the upright", "next to the upright", "angle of 1e+08 rad", "angle of 1e+15 rad")
BY_HAND: dict[str, Rate] = {
    **{f"spring pendulum, k = {k:g}": spring_pendulum(k, 0.0) for k in (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)},
    **{
        f"damped spring pendulum, k = {k:g}": spring_pendulum(k, 20.0 * math.sqrt(k))
        for k in (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
    },
    "Van der Pol, mu = 1000": van_der_pol(1e3),
    "Van der Pol, mu = 1e+06": van_der_pol(1e6),
    "Robertson, to 1e11": robertson,
    "Prothero-Robinson, rate 1e+06": lambda x, t: [-1e6 * (x[0] - math.cos(t)) - math.sin(t)],
    **{
        f"mass ratio {r:g}": bodies([1.0, r], [1.0, 1.0], center=[1.0, 1.0], inertia=[0.0, 0.0])
        for r in (1e-12, 1e-8, 1e-4, 1e4, 1e8, 1e12)
    },
    **{f"length ratio {r:g}": bodies([1.0, 1.0], [1.0, r]) for r in (1e-6, 1e6)},
    "massless links with armature": bodies(
        [0.0, 0.0, 1.0], [0.5, 0.5, 0.5], center=[0.0, 0.0, 0.25], inertia=[0.0, 0.0, 0.02], armature=1e-3
    ),
    "100 links": bodies([0.01] * 100, [0.01] * 100),
    "free body about its middle axis, Euler angles": in_digits(on_three_hinges(rotation.INERTIA)),
    "heavy top": in_digits(on_three_hinges(rotation.HEAVY, rotation.PULL)),
    "zero gravity": bodies([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], gravity=0.0),
    "relativistic oscillator": lambda x, t: [x[1], -x[0] * (1 - x[1] ** 2) ** 1.5],
    "Kapitza's pendulum": kapitza,
    **{f"velocity of {v:g} rad/s": lambda x, t: [x[1], -9.81 * math.sin(x[0])] for v in (1e4, 1e8)},
}
TOO_LARGE = {"1000 links"}  # the same builder as of 100


def test_every_case_is_checked_by_hand_or_by_its_closed_form() -> None:
    assert set(cases.names()) == {*BY_HAND, *CLOSED, *TOO_LARGE}


def around(case: StabilityCase, seed: int = 0) -> list[Array]:
    """The start, and states near it by a part of their sizes."""
    rng = np.random.default_rng(seed)
    start, size = np.array(case.start), np.array(case.size or [max(abs(x), 0.3) for x in case.start])
    return [start, *[start + 0.1 * size * rng.uniform(-1.0, 1.0, len(start)) for _ in range(STATES)]]


def values(case: StabilityCase, state: Array, t: float) -> dict[str, float]:
    given = state_inputs(case.model)
    result = dict(zip(given.states, state.tolist(), strict=True)) | given.parameters | dict.fromkeys(given.applied, 0.0)
    return result | ({"t": t} if given.timed else {})


@each_row("name", [param(name, marks=mark.slow if name == "100 links" else ()) for name in BY_HAND])
def test_equations_are_those_written_by_hand(name: str) -> None:
    case = cases.load(name)
    graph = state_equation(case.model)
    lost = condition(name)
    for row, state in enumerate(around(case)[: 2 if len(case.start) == LARGE else None]):
        found = np.array(list(graph.evaluate(values(case, state, 0.3 * row)).values()))
        expected = np.array(BY_HAND[name](state, 0.3 * row))
        size = terms(name, state, expected)
        assert np.max(np.abs(found - expected) / size) < ROUNDING * lost, row


def test_equations_of_a_chain_are_those_written_by_hand() -> None:
    """Ten links by the builder of the hundred, which take a while by hand."""
    case, by_hand = chains.long_chain(10, 1.0), bodies([0.1] * 10, [0.1] * 10)
    for state in around(case)[:2]:
        found = np.array(list(state_equation(case.model).evaluate(values(case, state, 0.0)).values()))
        expected = np.array(by_hand(state, 0.0))
        assert np.max(np.abs(found - expected)) < ROUNDING * np.max(np.abs(expected))


def condition(name: str) -> float:
    """How often the rounding of the mass matrix counts."""
    number = float(re.sub(r".*?([\d.e+-]+)$", r"\1", name)) if name[-1].isdigit() else 1.0
    if name.startswith("length ratio"):
        return max(number, 1.0) ** 2
    if name.startswith("mass ratio"):
        return 10.0 * max(number, 1.0)
    return {"100 links": 100.0}.get(name, 1.0)


def terms(name: str, state: Array, expected: Array) -> Array:
    """The size of the terms that the rates are made of: where they cancel, rounding is relative to them."""
    size = np.maximum(np.abs(expected), 1e-300)
    if "spring pendulum" in name:
        k = float(name.rsplit(" ", 1)[1])
        size[2] += 9.81 + k * abs(state[0]) + 20.0 * math.sqrt(k) * abs(state[2])
    if name.startswith(("Van der Pol", "Prothero")):
        size += float(name.rsplit(" ", 1)[1]) ** 2
    if name.startswith(("mass ratio", "length ratio")) or name.endswith(("links", "Euler angles", "top")):
        size[:] = np.max(np.abs(expected))
    return size


def test_the_free_body_starts_with_its_momentum_along_the_vertical() -> None:
    state = np.array(cases.load("free body about its middle axis, Euler angles").start)
    body = placed(on_three_hinges(rotation.INERTIA), *np.split(state, 2))["body"]
    omega, upward = body.axes.T @ body.spin, body.axes[2]
    assert omega == approx(np.array(rotation.OMEGA), abs=LAST_BITS)
    momentum = np.array(rotation.INERTIA) * omega
    assert momentum / np.linalg.norm(momentum) == approx(upward, abs=LAST_BITS)


WITH_INVARIANTS = [name for name, case in cases.table().items() if case.invariants and len(case.start) < LARGE]


@each_row("name", WITH_INVARIANTS)
def test_invariants_do_not_change_along_the_motion(name: str) -> None:
    """Their derivative along the rates, by differences in fifty digits."""
    case = cases.load(name)
    assert case.invariants is not None
    model = case.model
    graph, rates = case.invariants(model), state_equation(model)
    for state in around(case, seed=1)[:3]:
        point = values(case, state, 0.0)
        speed = high_precision.evaluate(rates, point, 80)
        direction = {key.removesuffix("_dot"): value for key, value in speed.items()}
        inside = {key: value for key, value in point.items() if key in graph.input_names}
        change = high_precision.directional(graph, inside, {k: v for k, v in direction.items() if k in inside})
        size = high_precision.path_size(graph, inside, {k: v for k, v in direction.items() if k in inside})
        for key in graph.outputs:
            assert abs(float(change[key])) <= ROUNDING * size[key], key  # constants of both graphs are rounded


@each_row("name", [*[name for name in cases.names() if name != "1000 links"], *slow("1000 links")])
def test_what_is_watched_can_be_measured(name: str) -> None:
    case = cases.load(name)
    invariants = (
        set(case.invariants(case.model).outputs) if case.invariants and len(case.start) <= LARGE else {"energy"}
    )
    assert case.criteria
    for criterion in case.criteria:
        what, *states = criterion.quantity.split()
        assert 0.0 <= criterion.bound < 1.0 or criterion.quantity == "energy", criterion
        assert criterion.scale > 0.0
        assert criterion.why
        if what == "error":
            assert case.solution() is not None
            assert all(int(each) < len(case.start) for each in states)
        else:
            assert criterion.quantity in invariants
    given = state_inputs(case.model)
    assert len(given.states) == len(case.start) == len(case.size or case.start)


def pendulum_from(angle: float) -> Closed:
    return lambda times: closed_forms.pendulum(times, angle, 9.81)


def orbit(name: str) -> Closed:
    return lambda times: closed_forms.kepler(times, cases.load(name).start)


CLOSED: dict[str, Closed] = {
    **{
        f"mass matrix of condition {4 / small:.0e}": lambda times: closed_forms.two_modes(times, (1.0, 0.5), (4.0, 1.0))
        for small in (1e-4, 1e-8, 1e-12)
    },
    **{name: pendulum_from(cases.load(name).q[0]) for name in LET_GO},
    "smallest velocity": lambda times: closed_forms.free_fall(times, 0.0, 5e-324, 0.0),
    "smallest velocity, hanging": lambda times: closed_forms.oscillator(times, 0.0, 5e-324, 9.81),
    "charge in a magnetic field": lambda times: closed_forms.cyclotron(times, (0.0, 0.0, 1.0, 0.5), 10.0),
    "damping by a growing mass": lambda times: closed_forms.oscillator(times, 1.0, 0.0, 4.0, 0.5),
    "exponential growth": lambda times: closed_forms.exponential(times, 1.0, 1.0),
    "exponential decay": lambda times: closed_forms.exponential(times, 1.0, -1.0),
    **{f"Kepler, e = {e:g}": orbit(f"Kepler, e = {e:g}") for e in (0.9, 0.99, 0.999)},
    "free body about its middle axis, Euler's equations": lambda times: closed_forms.free_rigid_body(
        times, rotation.INERTIA, rotation.OMEGA
    ),
    "Prothero-Robinson, rate 1e+06": closed_forms.cosine,
}


@each_row("name", CLOSED)
def test_solutions_are_closed_forms(name: str) -> None:
    """At the end the one in the file, and near the start the series. Constants of the graph may be rounded."""
    case = cases.load(name)
    rounded = 1e-15 if "mass matrix" not in name else 1e-15 * float(name.rsplit(" ", 1)[1])
    size = np.array(case.sizes(case.solution()))
    for t in (case.t_end, *([min(case.t_end, 1.0)] if case.series else [])):
        found = case.solution([t], digits=16)
        assert found is not None
        off = np.max(np.abs(found.deviation(CLOSED[name]([t]).x)[0]) / size)
        assert off <= rounded * max(case.growth or 1e9, 100.0)


STEP = 2.0**-36  # of the start; a growth up to 10^6 is still a matter of first order
DIGITS = 15


def growth(case: StabilityCase) -> float:
    """The largest relative change of a state at t_end for a small relative change of one state at the start.

    At the start relative to the state's value, or its size where that is zero; at t_end to its size.
    """
    model, size, worst = case.model, np.array(case.sizes(case.solution())), 0.0

    def end(start: tuple[float, ...]) -> Reference:
        at = split_state(model, start)
        return reference(model, *at, [case.t_end], digits=DIGITS)

    there = end(case.start)
    for i, value in enumerate(case.start):
        around = abs(value) or float(size[i])
        moved = value + STEP * around
        if moved == value:  # next to the smallest number
            continue
        beside = end((*case.start[:i], moved, *case.start[i + 1 :]))
        change = beside.deviation(there.x)[0] - there.deviation(there.x)[0]
        worst = max(worst, float(np.max(np.abs(change) / size)) / ((moved - value) / around))
    return worst


MEASURED = [name for name, case in cases.table().items() if case.growth is not None and case.series]
QUICK = {"next to the upright", "at the upright", "mass matrix of condition 4e+08", "damping by a growing mass"}
TO_BE_LARGE = 1e-4  # below it errors die out, and how far says nothing about a method


@mark.parametrize("name", [param(name, marks=() if name in QUICK else mark.slow) for name in MEASURED])
def test_growth_is_what_reference_solutions_give(name: str) -> None:
    case = cases.load(name)
    assert case.growth is not None
    assert case.growth == approx(growth(case), rel=0.1, abs=TO_BE_LARGE)


def test_the_stiffer_the_spring_the_nearer_the_rigid_rod() -> None:
    """The distance from the limit falls as 1/k; the stiffest are watched by the limit itself."""
    for k in (1e2, 1e4, 1e6, 1e8, 1e10, 1e12):
        case = cases.load(f"spring pendulum, k = {k:g}")
        found, rod = case.solution(), closed_forms.pendulum([case.t_end], 1.0, 9.81)
        assert found is not None
        distance = np.max(np.abs(found.x[0, [1, 3]] - rod.x[0]))
        assert distance < (100.0 * 9.81 / k if case.series else LAST_BITS)
