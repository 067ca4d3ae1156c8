"""Motions of free and ball joints against what mechanics says of them: closed forms, constants, other coordinates."""

import numpy as np
import pytest
from pytest import mark

import dynamics as dyn
from cgraph._shared import Array
from dynamics.multibody.algebra.spatial import from_quaternion, rotation
from tests.oracles.closed_forms import free_rigid_body

MOMENTS = [1.0, 2.0, 3.0]  # kg m^2, of the rotor
ROUNDING = 2e-15  # of some hundred steps, compensated
KEPT = 1e-13  # of the largest: what a run at the finest tolerance leaves of a constant
SAME = 1e-11  # of two runs in other coordinates, by steps of order 8


def rotor() -> dyn.Mechanism:
    """A body that turns about its center of mass."""
    body = dyn.Body("rotor", dyn.Joint("ball"), mass=1.0, inertia=np.diag(MOMENTS))
    return dyn.Mechanism([body], gravity=(0.0, 0.0, 0.0))


def rotations(quaternions: Array) -> Array:
    """(T, 3, 3)."""
    return np.array([from_quaternion(q) for q in quaternions])


@mark.optimized  # the bound is that of fused products
@mark.parametrize("omega", [[0.1, 1.0, 0.2], [2.0, 1.0, 0.2], [-0.3, -1.0, -2.0]])
def test_a_free_rotor_turns_as_jacobis_functions_say(omega: list[float]) -> None:
    pytest.importorskip("mpmath")
    times = [0.7, 10.0]
    exact = free_rigid_body(times, MOMENTS, omega)
    run = dyn.simulate(rotor(), [1.0, 0.0, 0.0, 0.0], omega, times[-1], "gauss6", dt=0.005, t_eval=times)
    assert exact.relative_error(run.qd) < 2 * ROUNDING
    momenta = np.einsum("tij,tj->ti", rotations(run.q), run.qd * MOMENTS)  # in space
    assert np.abs(momenta - np.multiply(MOMENTS, omega)).max() < 4 * ROUNDING * np.abs(momenta).max()


def spinning_top(lean: float, precession: float, spin: float) -> tuple[dyn.Mechanism, Array, Array, Array]:
    """Lagrange's top that leans by an angle; its state where it precesses and spins about its axis, and (A, C)."""
    mass, length, across, along = 1.5, 0.4, 0.1, 0.2  # moments about the center of mass
    body = dyn.Body(
        "top", dyn.Joint("ball"), mass=mass, center=[0.0, 0.0, length], inertia=np.diag([across, across, along])
    )
    model = dyn.Mechanism([body], gravity=(0.0, 0.0, -9.81))
    omega = np.array([0.0, precession * np.sin(lean), spin + precession * np.cos(lean)])
    q = np.array([np.cos(0.5 * lean), np.sin(0.5 * lean), 0.0, 0.0])
    return model, q, omega, np.array([across + mass * length**2, along, mass * 9.81 * length])


def test_lagranges_top_precesses_regularly_where_it_may() -> None:
    """A W^2 cos(lean) - C w_3 W + m g l = 0 (Goldstein, section 5.7): the axis goes round at W, the top about it."""
    lean, fast = 0.6, 2.0
    across, along, pull = spinning_top(lean, fast, 0.0)[3]
    spin = (across * fast**2 * np.cos(lean) + pull) / (along * fast) - fast * np.cos(lean)
    model, q, omega, _ = spinning_top(lean, fast, spin)
    run = dyn.simulate(model, q, omega, 4.0, "gauss6", dt=0.01, t_eval=np.linspace(0.0, 4.0, 9))
    x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    exact = [rotation(z, fast * t) @ rotation(x, lean) @ rotation(z, spin * t) for t in run.t]
    np.testing.assert_allclose(rotations(run.q), exact, atol=SAME)


def test_lagranges_top_keeps_its_energy_and_both_momenta_while_it_nods() -> None:
    model, q, omega, (across, along, _) = spinning_top(0.6, 0.0, 30.0)
    run = dyn.simulate(model, q, omega, 10.0, "gauss6", dt=0.0025, t_eval=np.linspace(0.0, 10.0, 101))
    momenta = run.qd * [across, across, along]
    upward = np.einsum("tij,tj->ti", rotations(run.q), momenta)[:, 2]
    assert np.ptp(rotations(run.q)[:, 2, 2]) > 0.01  # it nods
    for kept in (run.energy, momenta[:, 2], upward):
        assert np.ptp(kept) < KEPT * np.abs(kept).max()


def tumbling(steps: int) -> tuple[dyn.Trajectory, Array]:
    """A rotor that starts about its middle axis and turns over again and again, and its momentum in space, (T, 3)."""
    times = np.linspace(0.0, 0.01 * steps, 1001)
    options = {"t_eval": times, "estimate_error": False, "dt": 0.01}
    run = dyn.simulate(rotor(), [1.0, 0.0, 0.0, 0.0], [1e-3, 1.0, 1e-3], times[-1], "gauss6", **options)
    return run, np.einsum("tij,tj->ti", rotations(run.q), run.qd * MOMENTS)


@mark.parametrize("steps", [pytest.param(10**6, marks=mark.slow), 10**4])
def test_dzhanibekovs_rotor_keeps_energy_and_momentum_without_drift(steps: int) -> None:
    """They are quadratic, which Gauss's methods keep exactly; the momentum's direction in space, to their order."""
    run, momentum = tumbling(steps)
    length = np.linalg.norm(run.qd * MOMENTS, axis=1)
    assert run.qd[:, 1].min() < -0.99  # it has turned over
    assert np.ptp(run.energy) < ROUNDING * run.energy[0]
    assert np.ptp(length) < ROUNDING * length[0]
    assert np.abs(momentum - momentum[0]).max() < KEPT * length[0]
