"""Tableaus: the numbers of methods meet the conditions of their orders, and a new tableau is a new method."""

import math
import re
from collections.abc import Iterator
from fractions import Fraction
from functools import partial
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from dynamics.integrators import runge_kutta
from dynamics.integrators.radau import _POWERS, _T, _T_INVERSE
from dynamics.integrators.tableau import DOP853, PARTITIONED, TABLEAUS, Partitioned, Tableau
from tests.dynamics.planet import PERIHELION, planet, position
from tests.each_row import each_row

FITTED_ORDER = 0.05  # of a fitted order: what the next order adds at these steps
EXACT = Fraction(1, 10**40)
ROUNDING = 1e-14  # of sums of a dozen numbers of order 1
INVERTED = 1e-13  # of a 3 x 3 matrix that was inverted: some hundred roundings
COEFFICIENTS = 1e-11  # of sums of coefficients of dense output, which are as large as 300
DAMPED = 1e-9  # what an L-stable step of 1 leaves of a rate of 1e12
MANY_TOLERANCES = 200.0  # errors of accepted steps add up, and the flow makes them grow
BOGACKI_SHAMPINE = Tableau(
    3,
    c=(0, 1 / 2, 3 / 4),
    a=((), (1 / 2,), (0, 3 / 4)),
    b=(2 / 9, 1 / 3, 4 / 9),
    error=((5 / 72, -1 / 12, -1 / 9, 1 / 8),),
    estimate=3,
)  # Applied Mathematics Letters 2 (1989) 321
RALSTON = Tableau(2, c=(0, 2 / 3), a=((), (2 / 3,)), b=(1 / 4, 3 / 4))


@mark.parametrize("method", TABLEAUS.values(), ids=TABLEAUS)
def test_a_tableau_meets_the_conditions_of_its_order(method: Tableau) -> None:
    """Hairer, Norsett and Wanner I, table II.2.1: up to order four, one condition for each rooted tree."""
    s = len(method.b)
    a, b, c = np.zeros((s, s)), np.array(method.b), np.array(method.c)
    for i, row in enumerate(method.a):
        a[i, : len(row)] = row
    assert a.sum(axis=1) == approx(c, rel=ROUNDING)
    conditions = {1: [(b.sum(), 1)], 2: [(b @ c, 1 / 2)], 3: [(b @ c**2, 1 / 3), (b @ a @ c, 1 / 6)]}
    conditions[4] = [(b @ c**3, 1 / 4), ((b * c) @ a @ c, 1 / 8), (b @ a @ c**2, 1 / 12), (b @ a @ a @ c, 1 / 24)]
    met = [all(found == approx(needed, rel=ROUNDING) for found, needed in conditions[order]) for order in conditions]
    assert met == [order <= method.order for order in conditions]


@mark.parametrize("tableau", [tableau for tableau in (*TABLEAUS.values(), DOP853) if tableau.error])
def test_an_embedded_tableau_is_consistent(tableau: Tableau) -> None:
    stages = len(tableau.b)
    for row, c in zip(tableau.a, tableau.c, strict=True):
        assert math.fsum(row) == approx(c, abs=ROUNDING)
    for c, row in tableau.extra:
        assert math.fsum(row) == approx(c, abs=ROUNDING)
    for power in range(1, tableau.order + 1):  # the quadrature conditions
        assert math.fsum(b * c ** (power - 1) for b, c in zip(tableau.b, tableau.c, strict=True)) == approx(
            1 / power, abs=ROUNDING
        )
    for error in tableau.error:  # an estimate measures no constant rate
        assert math.fsum(error) == approx(0.0, abs=ROUNDING)
        assert len(error) == stages + 1
    dense = np.array(tableau.dense)
    assert dense.sum(axis=1)[:stages] == approx(np.array(tableau.b), abs=COEFFICIENTS)  # at s = 1 the step
    assert dense.sum(axis=1)[stages:] == approx(0.0, abs=COEFFICIENTS)
    nodes = np.array([*tableau.c, 1.0, *(c for c, _ in tableau.extra)])
    for power in range(min(4, tableau.order)):  # x_dot = t^power is followed exactly inside the step
        follows = dense.T @ nodes**power
        assert follows == approx(np.eye(len(follows))[power] / (power + 1), abs=COEFFICIENTS)


@mark.parametrize("method", PARTITIONED.values())
def test_a_partitioned_method_is_symplectic(method: Partitioned) -> None:
    """Hairer, Lubich and Wanner, theorem VI.4.6: w_i b_ij + w_j a_ji = w_i w_j."""
    a, b, w = np.array(method.a), np.array(method.b), np.array(method.w)
    assert abs(w[:, None] * b + (w[:, None] * a).T - np.outer(w, w)).max() < Fraction(1, 10**38)
    assert method.c == tuple(a.sum(axis=1))


@mark.parametrize("name", ["midpoint", "gauss4", "gauss6"])
def test_gauss_is_collocation_at_the_nodes_of_the_quadrature(name: str) -> None:
    """B(2 s) and C(s) (Hairer and Wanner II, section IV.5), to forty digits, from which its order follows."""
    method = PARTITIONED[name]
    stages = len(method.w)
    for k in range(1, 2 * stages + 1):
        assert abs(sum(w * c ** (k - 1) for w, c in zip(method.w, method.c, strict=True)) - Fraction(1, k)) < EXACT
    for row, c in zip(method.a, method.c, strict=True):
        for k in range(1, stages + 1):
            assert abs(sum(a * d ** (k - 1) for a, d in zip(row, method.c, strict=True)) - c**k / k) < EXACT


def test_the_numbers_of_radau() -> None:
    """Of Radau IIA's A, by collocation at its nodes."""
    c = np.array([(4.0 - math.sqrt(6.0)) / 10.0, (4.0 + math.sqrt(6.0)) / 10.0, 1.0])
    powers = np.arange(1, 4)
    a = c[:, None] ** powers / powers @ np.linalg.inv(c[:, None] ** (powers - 1))
    t, inverse = np.array(_T), np.array(_T_INVERSE)
    block = inverse @ np.linalg.inv(a) @ t
    assert t @ inverse == approx(np.eye(3), abs=ROUNDING)
    assert block[0, 1:] == approx(0.0, abs=INVERTED)
    assert block[1:, 0] == approx(0.0, abs=INVERTED)
    assert block[1, 1] == approx(block[2, 2], rel=INVERTED)
    assert block[1, 2] == approx(-block[2, 1], rel=INVERTED)
    for power in range(3):  # the polynomial through Z = s^(power + 1) is that power
        assert np.array(_POWERS) @ c ** (power + 1) == approx(np.eye(3)[power], abs=10.0 * INVERTED)


def _power(power: int, x: Any, t: cg.Node) -> list[cg.Node]:
    return [t ** float(power)]


def test_the_numbers_of_rodas() -> None:
    """The stability function of an L-stable method vanishes at infinity; x_dot = t^k is integrated to its order."""
    pytest.importorskip("llvmlite")
    assert METHODS["rodas"].order == 5
    stiff = dyn.OdeSystem(lambda x, t: [-1e12 * x[0]], ["x"])
    run = dyn.simulate(stiff, [1.0], None, 1.0, "rodas", rtol=1e3, atol=1e3, first_step=1.0)
    assert run.stats.steps == 1
    assert abs(run.q[-1, 0]) < DAMPED
    for power in range(5):
        ramp = dyn.OdeSystem(partial(_power, power), ["x"])
        run = dyn.simulate(ramp, [0.0], None, 1.0, "rodas", rtol=1e3, atol=1e3, first_step=1.0)
        assert run.q[-1, 0] == approx(1.0 / (power + 1), abs=COEFFICIENTS), power


def test_a_tableau_alone_is_a_method_of_equal_steps() -> None:
    with patch.dict(METHODS, ralston=runge_kutta(RALSTON)):
        ends = [dyn.simulate(planet(), *PERIHELION, 1.0, "ralston", dt=h).q[-1] for h in (1e-2, 5e-3)]
    errors = [np.abs(end - position(1.0)).max() for end in ends]
    assert math.log2(errors[0] / errors[1]) == approx(RALSTON.order, abs=FITTED_ORDER)


@pytest.fixture
def own() -> Iterator[None]:
    with patch.dict(METHODS, bs23=runge_kutta(BOGACKI_SHAMPINE)):
        yield


@pytest.mark.usefixtures("own")
def test_a_tableau_with_an_estimate_chooses_its_steps_and_has_dense_output() -> None:
    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-8, "backend": "auto"}
    plain = dyn.simulate(planet(), *PERIHELION, 1.0, "bs23", **options)
    times = np.linspace(0.0, 1.0, 101)
    dense = dyn.simulate(planet(), *PERIHELION, 1.0, "bs23", t_eval=times, **options)
    assert dense.stats.steps == plain.stats.steps < 2000
    at_steps = np.abs(plain.q - [position(t) for t in plain.t]).max()
    assert at_steps < MANY_TOLERANCES * 1e-8
    assert np.abs(dense.q - [position(t) for t in times]).max() < 2.0 * at_steps
    many = dyn.simulate_many(planet(), [PERIHELION[0]] * 3, PERIHELION[1], 1.0, "bs23", t_eval=times, **options)
    assert np.array_equal(many.q[1], dense.q)


@each_row(
    ("given", "said"),
    [
        ({"c": (0.0,)}, "a tableau of 2 weights b needs as many times c, rows a of 0 to 1 weights"),
        ({"a": ((), ())}, "and for error rows of 3, got c=(0.0, 1.0), a=((), ())"),
        ({"error": (0.1, -0.1, 0.0)}, "error=(0.1, -0.1, 0.0)"),
        ({"error": ((0.1, -0.1, 0.0),)}, "error of a tableau needs estimate, q where it falls as h^q, got 0"),
    ],
)
def test_weights_that_do_not_fit_are_refused_where_they_are_written(given: dict[str, Any], said: str) -> None:
    heun: dict[str, Any] = {"c": (0.0, 1.0), "a": ((), (1.0,)), "b": (0.5, 0.5)}
    with pytest.raises(ValueError, match=re.escape(said)):
        Tableau(2, **(heun | given))
