"""Chosen steps: they move the time, keep its clock, see what is not finite, stiffness and layers, and always end."""

import math
import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from dynamics.integrators import derive
from dynamics.integrators.tableau import DOP853, DOPRI5, EULER, real_stability
from dynamics.simulation.run_options import Span, Steps
from dynamics.simulation.stepper import stepper
from dynamics.simulation.steps.step_program import compile_steps, step_program
from tests.dynamics.linkages import windows
from tests.dynamics.step_options import ADAPTIVE
from tests.early_end import stops
from tests.slow import slow

EXPLICIT = ["dopri5", "dop853"]
STIFF = ["rodas", "radau"]
NEAR = 1e-6  # relative, of the instant of a singularity
FOLLOWED = 1e-6  # of a solution at tolerances of 1e-9
MOST = 20000  # trials, far more than a collapse takes


@cache
def first_order(*rates: Any) -> dyn.OdeSystem:
    return dyn.OdeSystem(lambda x, t: [rate(x, t) for rate in rates], [f"x{k}" for k in range(len(rates))])


# Each is singular at t = 1: a blow-up, a rate without bound, a pole of t, a root that ends, and a tangent.
SINGULAR: dict[str, tuple[dyn.OdeSystem, list[float]]] = {
    "square": (first_order(lambda x, t: x[0] * x[0]), [1.0]),
    "cube": (first_order(lambda x, t: 0.5 * x[0] ** 3.0, lambda x, t: -x[1]), [1.0, 1.0]),
    "collapse": (first_order(lambda x, t: -0.5 / x[0]), [1.0]),
    "pole": (first_order(lambda x, t: 1.0 / (1.0 - t) ** 2.0), [0.0]),
    "tangent": (first_order(lambda x, t: math.pi / 2.0 * (1.0 + x[0] * x[0])), [0.0]),
}


@stops
@mark.parametrize("method", ADAPTIVE)
def test_no_run_passes_a_singularity_and_every_row_is_a_state_at_a_time_of_its_own(method: str) -> None:
    for name, (system, start) in SINGULAR.items():
        run = dyn.simulate(system, start, None, 2.0, method, max_steps=MOST)
        assert np.all(np.diff(run.t) > 0.0), name
        assert np.isfinite(run.q).all(), name
        assert not run.stats.success, name
        assert run.stats.message.startswith("stopped at t = 1 s: "), run.stats.message
        assert "x0" in run.stats.message
        assert run.t[-1] == approx(1.0, rel=NEAR), name


@mark.parametrize("method", ADAPTIVE)
@mark.parametrize("t_end", [7.0, -5.0])
def test_the_clock_makes_the_steps_of_the_state(method: str, t_end: float) -> None:
    problem = derive(first_order(lambda x, t: cg.cos(t) * x[0]), {})
    compiled = compile_steps(step_program(problem, METHODS[method], dense=True), "auto", True)
    blocks = list(stepper(compiled, Steps(method)).blocks(np.array([1.0]), Span(t_end, t0=0.3)))
    t, h, t_old = (np.concatenate([getattr(block, name) for block in blocks]) for name in ("t", "h", "t_old"))
    assert np.array_equal(t - t_old, h)
    assert np.array_equal(t_old[1:], t[:-1])
    assert np.all(np.sign(h) == math.copysign(1.0, t_end))
    assert t[-1] == t_end


@mark.parametrize("method", STIFF)
@mark.parametrize("rate", [1e3, 1e8, 1e13])
def test_an_initial_layer_is_followed(method: str, rate: float) -> None:
    """y' = -rate (y - z), z' = -z: the layer of y has the length 1 / rate."""
    system = first_order(lambda x, t: -rate * (x[0] - x[1]), lambda x, t: -x[1])
    times = np.array([0.5, 1.0, 5.0, 1e-2 * rate]) / rate
    run = dyn.simulate(system, [2.0, 1.0], None, 1.0, method, t_eval=times)
    slow = rate / (rate - 1.0)
    exact = slow * np.exp(-times) + (2.0 - slow) * np.exp(-rate * times)
    assert run.q[:, 0] == approx(exact, abs=FOLLOWED)
    assert dyn.simulate(system, [rate / (rate - 1.0), 1.0], None, 1.0, method).stats.steps < 150


@mark.parametrize("method", EXPLICIT)
def test_a_system_that_is_not_stiff_is_not_called_so(method: str) -> None:
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    for rtol in (1e-3, 1e-12):
        assert dyn.simulate(arm, [1.0, 0.5], [0.0, 0.0], 20.0, method, rtol=rtol).stats.warnings == ()


def test_where_stability_ends_on_the_real_axis() -> None:
    """Of Euler's method at 2; for the others Hairer and Wanner's programs take 3.25 and 6.1, a little inside."""
    assert [real_stability(tableau) for tableau in (EULER, DOPRI5, DOP853)] == approx([2.0, 3.25, 6.1], rel=0.05)


@mark.parametrize("method", ADAPTIVE)
def test_a_state_that_stays_zero_needs_no_absolute_tolerance(method: str) -> None:
    system = first_order(lambda x, t: x[1], lambda x, t: -x[0], lambda x, t: 0.0 * x[2])
    for atol in (0.0, 1e-300):
        run = dyn.simulate(system, [1.0, 0.0, 0.0], None, 10.0, method, atol=atol, max_steps=MOST)
        assert run.stats.success
        assert run.q[-1] == approx([math.cos(10.0), -math.sin(10.0), 0.0], abs=FOLLOWED)


@mark.parametrize("method", EXPLICIT)
def test_a_tolerance_below_rounding_is_raised_and_said(method: str) -> None:
    system = first_order(lambda x, t: x[1], lambda x, t: -x[0])
    with pytest.warns(dyn.SimulationWarning, match="rtol = 1e-17 .* is below the rounding of a step: raised to"):
        run = dyn.simulate(system, [1.0, 0.0], None, 1.0, method, rtol=1e-17, atol=0.0, max_steps=MOST)
    assert run.stats.success


@stops
@mark.parametrize("method", ADAPTIVE)
def test_the_shortest_spans_end(method: str) -> None:
    system = first_order(lambda x, t: -x[0])
    for t0, t_end in ((0.0, 5e-324), (0.0, 1e-300), (1.0, 1.0 + 2.0**-51), (1e9, 1e9 - 1e-6)):
        run = dyn.simulate(system, [1.0], None, t_end, method, t0=t0, max_steps=100)
        assert (
            run.stats.success
            or "is below the resolution" in run.stats.message
            or "however small" in (run.stats.message)
        )
        assert run.q[-1] == approx([1.0], abs=1e-5)


@mark.parametrize("method", ["dop853", "radau", *slow("dopri5", "rodas", "taylor")])
@mark.parametrize("h", [2e-7, *slow(1e-6, 1e-4)])
def test_where_a_linkage_can_go_on_in_two_ways_it_keeps_its_energy_or_says_why_not(method: str, h: float) -> None:
    """Steps that end near a flat position have the rounding of its constraints over their distance.

    Which run meets one, and what it says, hangs on last bits, and so on the machine code.
    """
    model, _, _ = windows(2)
    ways, length = np.array([1.0, -1.0, 1.0, -1.0, 1.0]), 1e-4
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = dyn.simulate(model, -length * ways, 4.0 * ways, length, method, max_step=h, max_steps=3000)
    assert np.ptp(run.energy) < 1e-6 * np.abs(run.energy).max() or said or not run.success


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
def test_a_run_that_creeps_at_a_flat_position_ends_and_names_its_rows() -> None:
    """The rounding of the constraints over the distance from it is more than the tolerance of a step."""
    model, q, qd = windows(3)
    run = dyn.simulate(model, q, qd, 10.0, rtol=1e-12)
    assert (run.success, run.stats.steps < MOST) == (False, True)
    assert "; near by 'coupler " in run.stats.message
    assert "nothing that the other constraints do not say: coordinate 'crank 0' = " in run.stats.message
