"""Compositions: they meet the conditions of their orders, can be turned in time, and stop where there is no inertia."""

import math
from fractions import Fraction
from itertools import accumulate

from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics.integrators.tableau import COMPOSITIONS, Composition
from tests.dynamics.step_options import step
from tests.early_end import stops

Series = dict[tuple[int, ...], Fraction]  # of words in X_1, X_3, X_5, .., whose weights are their indices

CONDITIONS = 2e-13  # words of up to eight letters: products of numbers as large as two, rounded to float64
THERE_AND_BACK = 1e-12  # some hundred steps of rounding


def product(left: Series, right: Series, weight: int) -> Series:
    result: Series = {}
    for a, x in left.items():
        for b, y in right.items():
            if sum(a) + sum(b) <= weight:
                result[a + b] = result.get(a + b, Fraction(0)) + x * y
    return result


def flow(step: Fraction, weight: int) -> Series:
    """exp(step X_1 + step^3 X_3 + ..): any symmetric method, with no relation between its X."""
    letters: Series = {(k,): step**k for k in range(1, weight + 1, 2)}
    powers = accumulate(
        range(1, weight + 1),
        lambda s, k: {w: x / k for w, x in product(s, letters, weight).items()},
        initial={(): Fraction(1)},
    )
    result: Series = {}
    for power in powers:
        for word, x in power.items():
            result[word] = result.get(word, Fraction(0)) + x
    return result


def defect(composition: Composition, weight: int) -> Fraction:
    """What the product of the flows differs from exp(X_1), in words of that weight at most."""
    whole: Series = {(): Fraction(1)}
    for length in composition.steps:
        whole = product(whole, flow(Fraction(length), weight), weight)
    return max(abs(x - (Fraction(1, math.factorial(len(w))) if set(w) <= {1} else 0)) for w, x in whole.items())


@mark.parametrize("name", COMPOSITIONS)
def test_a_composition_meets_the_conditions_of_its_order_and_no_more(name: str) -> None:
    composition = COMPOSITIONS[name]
    assert composition.steps == composition.steps[::-1]
    assert defect(composition, composition.order) < CONDITIONS
    assert defect(composition, composition.order + 1) > 1e-6


WITHOUT_INERTIA = {  # {name: (L, parameters, start)}; 'slider' has no inertia, at the start or from some time on
    "by a parameter": (
        lambda q, qd, t, p: 0.5 * qd[0] ** 2 + 0.5 * p["m"] * qd[1] ** 2 - q[0] * q[1],
        {"m": 0.0},
        [1.0, 0.5],
    ),
    "at the start": (lambda q, qd, t, p: 0.5 * qd[0] ** 2 + 0.5 * q[0] * qd[1] ** 2 - q[1], {}, [0.0, 0.0]),
    "on the way": (
        lambda q, qd, t, p: 0.5 * qd[0] ** 2 + 0.5 * (1.0 - 4.0 * t) * qd[1] ** 2 - q[1],
        {},
        [0.0, 0.0],
    ),
}


@stops
@mark.parametrize("method", ["verlet", "gauss4", "yoshida4"])
@mark.parametrize("case", WITHOUT_INERTIA)
def test_a_coordinate_without_inertia_stops_the_run(method: str, case: str) -> None:
    lagrangian, parameters, start = WITHOUT_INERTIA[case]
    model = dyn.System(lagrangian, ["cart", "slider"], parameters)
    run = dyn.simulate(model, start, [0.0, 0.0], 1.0, method, **step(method, 0.01), backend="python")
    assert not run.stats.success
    assert "after the step" in run.stats.message or "did not converge" in run.stats.message
    assert run.t[-1] == approx(0.25 if case == "on the way" else 0.0, abs=0.011)


def test_an_inertia_may_be_negative() -> None:
    negative = dyn.System(lambda q, qd, t: -0.5 * qd[0] ** 2 + 0.5 * q[0] ** 2, ["x"])
    assert dyn.simulate(negative, [1.0], [0.0], 1.0, "verlet").q[-1] == approx(math.cos(1.0), abs=1e-6)


@mark.parametrize("form", ["velocity", "momentum"])
@mark.parametrize("name", ["verlet", "yoshida4", "kahan_li8"])
def test_time_can_be_turned_where_the_mass_changes_with_it(name: str, form: str) -> None:
    """A step is symmetric for kinetic energies of any time: what is not is of first order, whatever its name."""
    growing = dyn.System(lambda q, qd, t: 0.5 * cg.exp(0.3 * t) * (qd[0] ** 2 - 4.0 * q[0] ** 2), ["x"])
    how = {"dt": 0.05, "form": form, "backend": "python", "estimate_error": False}
    there = dyn.simulate(growing, [1.0], [0.5], 1.0, name, **how)
    back = dyn.simulate(growing, there.q[-1], there.qd[-1], 0.0, name, t0=1.0, **how)
    assert [back.q[-1, 0], back.qd[-1, 0]] == approx([1.0, 0.5], rel=THERE_AND_BACK)
