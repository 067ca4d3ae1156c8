"""The Taylor method: its series against those of mpmath, its runs against 30 digits, and what it refuses."""

import itertools
import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from cgraph.core.node import apply
from cgraph.extend import OPS
from dynamics.integrators import derive
from tests.slow import slow

ROUNDINGS = 2e-14  # of a few dozen steps
SERIES: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "quotient": (lambda x, t: (1.0 + t) / (2.0 + x * x), lambda x, t: (1 + t) / (2 + x * x)),
    "root": (lambda x, t: cg.sqrt(1.0 + x * x + t), lambda x, t: mpmath.sqrt(1 + x * x + t)),
    "power": (lambda x, t: (2.0 + x) ** -1.5, lambda x, t: (2 + x) ** mpmath.mpf(-1.5)),
    "whole": (lambda x, t: 0.1 * x**3.0 + (x + 2.0) ** -3.0, lambda x, t: x**3 / 10 + (x + 2) ** -3),
    "powers at 0": (
        lambda x, t: 1.0 + (x - 0.3) ** 4.0 - 2.0 * (x - 0.3) ** 65.0 + t**3.0,
        lambda x, t: 1 + (x - mpmath.mpf(0.3)) ** 4 - 2 * (x - mpmath.mpf(0.3)) ** 65 + t**3,
    ),
    "length": (lambda x, t: cg.hypot(1.0 + x, t), lambda x, t: mpmath.hypot(1 + x, t)),
    "waves": (lambda x, t: cg.sin(x) * cg.cos(3.0 * t), lambda x, t: mpmath.sin(x) * mpmath.cos(3 * t)),
    "exponential": (lambda x, t: cg.exp(-x) + cg.log(2.0 + t), lambda x, t: mpmath.exp(-x) + mpmath.log(2 + t)),
    "tangents": (lambda x, t: cg.tanh(x - t) + cg.atan(x), lambda x, t: mpmath.tanh(x - t) + mpmath.atan(x)),
}


@mark.parametrize("name", SERIES)
def test_a_run_is_that_of_mpmath(name: str) -> None:
    ours, theirs = SERIES[name]
    run = dyn.simulate(
        dyn.OdeSystem(lambda x, t: [ours(x[0], t)], ["x"]), [0.3], None, 0.2, "taylor", rtol=1e-15, atol=1e-16
    )
    with mpmath.workdps(18):
        exact = mpmath.odefun(lambda t, x: [theirs(x[0], t)], 0, [mpmath.mpf(0.3)])(0.2)[0]
    assert run.q[-1, 0] == approx(float(exact), rel=ROUNDINGS)
    assert run.stats.steps < 60


def test_the_order_follows_the_tolerance_and_the_time_has_no_unit() -> None:
    pytest.importorskip("llvmlite")
    for unit in (1e-12, 1.0, 1e12):  # s
        turning = dyn.OdeSystem(lambda x, t, p: [p["w"] * x[1], -p["w"] * x[0]], ["a", "b"], {"w": 1.0 / unit})
        steps = []
        for tolerance in (1e-4, 1e-15):
            run = dyn.simulate(turning, [1.0, 0.0], None, 10.0 * unit, "taylor", rtol=tolerance, atol=tolerance)
            assert abs(run.q[-1] - [math.cos(10.0), -math.sin(10.0)]).max() < 10.0 * tolerance
            steps.append(run.stats.steps)
        assert max(steps) < 3 * min(steps)  # as in Jorba and Zou: a tighter tolerance takes a higher order


def test_a_series_that_is_too_long_is_refused() -> None:
    arm = dyn.planar_arm([1.0] * 20, [1.0] * 20)
    with raises(ValueError, match=r"of order 21 needs \d+ operations .* at most 300000: take another method, such as"):
        dyn.simulate(arm, [0.1] * 20, [0.0] * 20, 1.0, "taylor", rtol=1e-15)
    seven = derive(dyn.planar_arm([1.0] * 7, [1.0] * 7), {})
    assert "x" in dyn.METHODS["taylor"].program(seven, False).registers  # of order 22


@mark.parametrize("length", [1e9, -1e9, *slow(1e3, 1e12, 1e20, 1e50)])
@mark.parametrize("rtol", [1e-6, 1e-15, *slow(1e-9, 1e-12)])
@mark.parametrize("atol", [None, 1e-9])
def test_a_run_may_be_far_longer_than_the_motion(length: float, rtol: float, atol: float | None) -> None:
    """Coefficients of a time as long as the run overflow."""
    pytest.importorskip("llvmlite")
    swing = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2.0 - 0.5 * q[0] ** 2.0, ["x"])
    down = dyn.Event("down", lambda q, qd, t: q[0], terminal=True)
    run = dyn.simulate(swing, [1.0], [0.0], length, "taylor", rtol=rtol, atol=atol, events=[down], max_steps=100)
    assert run.success, run.stats.message
    assert run.t[-1] == approx(math.copysign(math.pi / 2.0, length), abs=20.0 * max(rtol, atol or 0.0))


@mark.parametrize("length", [10.0, *slow(1.0, 1e3, 1e6)])
@mark.parametrize("tolerance", [1e-6, 1e-12, *slow(1e-8, 1e-10)])
def test_the_first_step_misses_no_more_than_others(length: float, tolerance: float) -> None:
    """From rest, where what a velocity would gain in the whole run, by its first rate, says nothing of its size."""
    pytest.importorskip("llvmlite")
    arm, start = dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]), ([1.5, 0.2, -0.1], [0.0] * 3)
    motion = dyn.prepare(arm, "taylor", rtol=tolerance).start(*start, t_end=length)
    motion.step()
    exact = dyn.simulate(arm, *start, motion.t, "taylor", rtol=1e-15, t_eval=[motion.t])
    assert abs(motion.q - exact.q[-1]).max() < 0.03 * tolerance
    assert abs(motion.qd - exact.qd[-1]).max() < 0.03 * tolerance


def test_what_the_series_at_the_start_does_not_show_is_seen_at_the_end_of_the_step() -> None:
    """A pulse far from the start, where all its coefficients are rounding: the defect cuts the step."""
    pytest.importorskip("llvmlite")
    pulse = dyn.OdeSystem(lambda x, t: [cg.exp(-100.0 * (t - 2.0) ** 2.0)], ["x"])
    run = dyn.simulate(pulse, [0.0], None, 2.0, "taylor", rtol=1e-12, atol=1e-12)
    assert run.q[-1, 0] == approx(math.sqrt(math.pi / 100.0) / 2.0, rel=1e-9)


@mark.parametrize("power", [2.0, 3.0, 4.0, 5.0, 9.0])
def test_a_chain_of_whole_powers_starts_at_0(power: float) -> None:
    """As Fermi, Pasta and Ulam's: springs of x^2 + |power| x^power, all at 0 but one velocity, and a force t^power."""

    def lagrangian(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> Any:
        stretches = [b - a for a, b in itertools.pairwise([0.0, *q, 0.0])]
        return sum(0.5 * v**2.0 for v in qd) - sum(0.5 * d**2.0 + d**power / power for d in stretches)

    chain = dyn.System(lagrangian, ["a", "b", "c"], forces=lambda q, qd, t: [0.0, 0.0, 0.1 * t**power])
    start = [0.0, 0.0, 0.0], [0.3, 0.0, 0.0]
    run, other = [dyn.simulate(chain, *start, 1.0, method) for method in ("taylor", "dop853")]
    assert run.success
    assert run.stats.steps < 40
    np.testing.assert_allclose(run.q[-1], other.q[-1], rtol=1e-8)


@mark.parametrize("name", [name for name, row in OPS.items() if row.piece is not None])
def test_an_operation_of_pieces_has_the_series_of_its_piece_or_is_named(name: str) -> None:
    """A step ends where the piece changes; an equality, or a choice by no comparison, has no piece beside it."""
    row = OPS[name]

    def rate(x: list[cg.Node], t: cg.Node) -> list[cg.Node]:
        with cg.tag("friction"):
            arguments = [x[0], 0.2 - x[0], 0.5 * x[0]][: row.arity]
            return [apply(row, *arguments) - 0.25]

    model = dyn.OdeSystem(rate, ["x"])
    if name in ("equal", "not_equal", "where"):
        with raises(ValueError, match=f"equations that are smooth, and {name} has no Taylor series.*friction"):
            dyn.simulate(model, [0.3], None, 1.0, "taylor")
    else:
        run, other = [dyn.simulate(model, [0.3], None, 1.0, method) for method in ("taylor", "radau")]
        assert run.q[-1] == approx(other.q[-1], rel=1e-8)
