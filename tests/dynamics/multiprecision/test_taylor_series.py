"""Taylor series of every operation, against mpmath."""

from collections.abc import Callable
from contextlib import nullcontext
from decimal import Decimal
from typing import Any

import mpmath
from pytest import raises

import cgraph as cg
from cgraph.core.node import apply
from cgraph.operations.operation import OPS
from dynamics.multiprecision.decimal_numbers import mpmath_context, value, working
from dynamics.multiprecision.taylor_integrator import Series
from dynamics.systems.ode_system import OdeSystem
from tests.each_row import each_row
from tests.high_precision import OPERATIONS

ORDER = 12
TWELVE_ORDERS = 1e-25  # relative, of numbers with 60 digits that mpmath differentiates numerically


def paths(point: tuple[float, ...], number: Callable[[Any], Any], t: Any) -> list[Any]:
    """Arguments that move through the point: of each, series that do not end soon."""
    turns = [(1.0, 0.25, 0.5), (-0.7, 0.375, 0.25), (0.4, -0.5, 0.125)]
    if len(point) == 3:  # the condition of `where` stays
        turns.insert(0, (0.0, 0.0, 0.0))
    return [
        number(a) + number(b) * t + number(c) * t * t + number(d) * t * t * t
        for a, (b, c, d) in zip(point, turns, strict=False)
    ]


def coefficients(build: Callable[[list[cg.Node]], cg.Node], point: tuple[float, ...]) -> list[mpmath.mpf]:
    """Taylor coefficients of build(arguments), as k times those of its integral."""
    system = OdeSystem(lambda x, t: [build(paths(point, float, t))], ["y"])
    with working(60):
        series = Series(system.graph, ["y"], {}, mpmath_context(60))
        (found,) = series.expand([Decimal(0)], Decimal(0), ORDER + 1)
        return [mpmath.mpf(str(k * found[k])) for k in range(1, ORDER + 2)]


def assert_series(build: Callable[[list[Any]], Any], exact: Callable[..., Any], point: tuple[float, ...]) -> None:
    """The coefficients of nodes are those that mpmath finds of its own function."""
    with mpmath.mp.workdps(60):
        found = coefficients(build, point)
        expected = mpmath.taylor(lambda t: exact(*paths(point, mpmath.mpf, t)), 0, ORDER)
        assert max(abs(a - b) for a, b in zip(found, expected, strict=True)) <= TWELVE_ORDERS * max(map(abs, expected))


@each_row(("name", "point"), [(op.name, point) for op in OPS.values() for point in op.samples])
def test_series_of_every_operation_is_that_of_mpmath(name: str, point: tuple[float, ...]) -> None:
    """An operation without a multiprecision value says so, and one that jumps."""
    lacks = "Taylor series" if OPS[name].jumps is not None else ""
    try:
        value(OPS[name], mpmath_context(60))
    except NotImplementedError:
        lacks = lacks or "multiprecision value"
    with raises(NotImplementedError, match=f"{name} has no {lacks}") if lacks else nullcontext():
        assert_series(lambda args: apply(OPS[name], *args), OPERATIONS[name], point)


@each_row("exponent", [-3.0, -1.0, 0.0, 0.5, 1.0, 2.0, 5.0, 7.5, 100.0])
def test_series_of_powers(exponent: float) -> None:
    assert_series(lambda args: args[0] ** exponent + 0.0 * args[0], lambda x: x**exponent, (1.3,))


def test_series_folds_no_constants_in_float64() -> None:
    """0.1 + 0.2 of the graph is the sum of two float64, not the float64 next to it."""
    with mpmath.mp.workdps(60):
        found = coefficients(lambda args: (args[0] * 0.0 + 0.1) + (0.2 + args[0] * 0.0), (1.0,))
        exact = mpmath.mpf(0.1) + mpmath.mpf(0.2)
        assert abs(found[0] - exact) < 1e-50 < abs(found[0] - mpmath.mpf(0.1 + 0.2))


def test_zero_wins_over_infinity_in_a_zero_safe_product() -> None:
    with working(40):
        product, zero, infinite = value(OPS["zero_safe_mul"], mpmath_context(40)), Decimal(0), Decimal("inf")
        assert product(zero, infinite) == product(infinite, zero) == 0
        assert product(Decimal(2), Decimal(3)) == 6
