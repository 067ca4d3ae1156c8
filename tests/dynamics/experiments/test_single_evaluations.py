"""Single evaluations and huge angles of the stability table: exact values from other sources, errors that are seen."""

from dataclasses import replace
from typing import Any

import numpy as np
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.stability import single_evaluations
from dynamics.multibody.builders import arm_of_links, planar_links
from tests.dynamics.lagrange_by_mpmath import floats, lagrange
from tests.dynamics.models import Array
from tests.dynamics.tree_in_digits import tree_in_digits

HEAVY = next(each for each in single_evaluations.FAMILIES if each.name == "last mass 1e12")
EXACT = 1e-13  # of the largest value: differences of 80 digits, and rounding of what is compared
SLOPES = 1e-5  # relative: central differences with steps of 1e-7


def random_arm(n: int) -> tuple[dyn.Mechanism, Array, Array, Array]:
    rng = np.random.default_rng(n)
    arm = dyn.planar_arm(rng.uniform(0.5, 1.5, n).tolist(), rng.uniform(0.5, 1.5, n).tolist(), 0.1)
    q, qd, third = rng.uniform(-3.0, 3.0, n), rng.normal(size=n), rng.normal(size=n)
    return arm, q, qd, third


def exact(arms: single_evaluations.Arms, arm: dyn.Mechanism, *state: Array) -> Array:
    return np.array(arms.exact(arm, np.concatenate(state)))


def arms_of(task: str, n: int) -> single_evaluations.Arms:
    return single_evaluations.Arms(single_evaluations.TASKS[task], n, ["python"])


@mark.parametrize("n", [1, 2, 5])
def test_exact_torques_are_those_of_lagranges_equation(n: int) -> None:
    """By differences of L itself in 80 digits: another formula, other arithmetic."""
    arm, q, qd, qdd = random_arm(n)
    expected = lagrange(arm, {"q": q, "qd": qd, "qdd": qdd})
    found = exact(arms_of("inverse dynamics", n), arm, q, qd, qdd).astype(np.float64)
    assert np.max(np.abs(found - floats(expected.tau))) < EXACT * expected.largest


def test_exact_accelerations_are_those_of_newtons_and_eulers_equations() -> None:
    """Of a heavy link at the end of light ones, where float64 has no digit."""
    arm = single_evaluations.arm_of(HEAVY, 8, np.random.default_rng(8))
    _, q, qd, tau = random_arm(8)
    expected = tree_in_digits(arm, q, qd, 0.0 * q, tau)["accelerations"]
    assert exact(arms_of("forward dynamics", 8), arm, q, qd, tau).astype(np.float64) == approx(expected, rel=EXACT)


@mark.parametrize("task", single_evaluations.TASKS)
def test_the_condition_is_what_changes_of_the_data_make(task: str) -> None:
    """Differences of the exact values, each input and parameter changed by itself."""
    n, step = 3, 1e-7
    arm, q, qd, third = random_arm(n)
    arms, expected = arms_of(task, n), np.zeros(n)

    def change(there: Any, back: Any) -> None:
        nonlocal expected
        expected += np.abs((there - back).astype(np.float64)) / (2.0 * step)

    point = np.concatenate([q, qd, third])
    for i in range(3 * n):
        moved = [point * (1.0 + sign * step * (np.arange(3 * n) == i)) for sign in (1, -1)]
        change(*[exact(arms, arm, *each.reshape(3, n)) for each in moved])
    links, damping, gravity = planar_links(arm), arm.system.damping, -float(np.asarray(arm.gravity)[2])
    for i, link in enumerate(links):
        for what in ("mass", "length", "center", "inertia"):
            pair = []
            for sign in (1, -1):
                changed = link._replace(**{what: getattr(link, what) * (1.0 + sign * step)})
                pair.append(arm_of_links([*links[:i], changed, *links[i + 1 :]], damping, gravity))
            change(*[exact(arms, each, q, qd, third) for each in pair])
        scaled = [tuple([c * (1.0 + sign * step * (j == i)) for j, c in enumerate(damping)]) for sign in (1, -1)]
        change(*[exact(arms, arm_of_links(links, each, gravity), q, qd, third) for each in scaled])
    change(
        *[exact(arms, arm_of_links(links, damping, gravity * (1.0 + sign * step)), q, qd, third) for sign in (1, -1)]
    )
    found = arms.condition(arm, point)
    assert found == approx(expected, rel=SLOPES)


@mark.parametrize("task", single_evaluations.TASKS)
@mark.parametrize("family", single_evaluations.FAMILIES[:5], ids=lambda family: family.name)
def test_single_evaluations_are_within_the_bound(task: str, family: single_evaluations.Family) -> None:
    assert single_evaluations.measurement(family, arms_of(task, 4)).meets


def test_a_heavy_mass_at_the_end_of_a_chain_is_beyond_the_bound() -> None:
    assert single_evaluations.measurement(HEAVY, arms_of("forward dynamics", 8)).value > 1e6


def test_a_constant_that_is_off_is_seen() -> None:
    """A mass wrong by 1e-13 is some hundred ulps of the condition."""
    task = single_evaluations.TASKS["forward dynamics"]

    def off(arm: Any) -> cg.Graph:
        if not isinstance(arm, dyn.Mechanism):
            return task(arm)
        first = replace(arm.bodies[0], mass=arm.bodies[0].mass * (1.0 + 1e-13))
        return task(replace(arm, bodies=(first, *arm.bodies[1:])))

    arms = single_evaluations.Arms(off, 3, ["python"])
    assert not single_evaluations.measurement(single_evaluations.FAMILIES[0], arms).meets
