"""Integrators: their orders, their errors beside the tolerance, what they conserve, and how they stop."""

import itertools
import math
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.integrators import METHODS, derive, mechanics, runge_kutta
from dynamics.integrators.dop853 import DOP853
from dynamics.integrators.radau import _A, _POWERS, _T, _T_INVERSE
from dynamics.integrators.rosenbrock import RODAS5P
from dynamics.integrators.symplectic import GAUSS4, GAUSS6, MIDPOINT, SYMPLECTIC_EULER, VERLET, Partitioned
from dynamics.integrators.tableau import DOPRI5, Tableau
from dynamics.systems.system import System
from tests.dynamics.step_options import step

FIXED = [name for name, method in METHODS.items() if not method.adaptive]
ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
ECCENTRICITY = 0.3
FITTED_ORDER = 0.05  # of a fitted order: what the next order adds at these steps


def planet() -> System:
    return System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.sqrt(q[0] ** 2 + q[1] ** 2), ["x", "y"])


PERIHELION = ([1.0 - ECCENTRICITY, 0.0], [0.0, math.sqrt((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY))])


def position(t: float) -> list[float]:
    """Of the planet with period 2 pi, by Kepler's equation E - e sin E = t."""
    anomaly = t
    for _ in range(50):
        anomaly -= (anomaly - ECCENTRICITY * math.sin(anomaly) - t) / (1.0 - ECCENTRICITY * math.cos(anomaly))
    return [math.cos(anomaly) - ECCENTRICITY, math.sqrt(1.0 - ECCENTRICITY**2) * math.sin(anomaly)]


def cart() -> System:
    """A pendulum on a cart with friction between them: a mass matrix of q, and a force of the velocities."""
    return System(
        lambda q, qd, t: (
            qd[0] ** 2
            + 0.5 * (qd[0] + qd[1] * cg.cos(q[1])) ** 2
            + 0.5 * (qd[1] * cg.sin(q[1])) ** 2
            + 9.81 * cg.cos(q[1])
        ),
        ["cart", "angle"],
        damping=[0.1, 0.05],
    )


STEPS = {"euler": (4000, 32000), "symplectic_euler": (2000, 16000), "rk4": (400, 1600), "verlet": (400, 1600)}
STEPS |= {"midpoint": (400, 1600), "gauss4": (50, 200), "gauss6": (40, 104)}


@mark.parametrize("method", FIXED)
@mark.parametrize("system", ["planet", "cart"])
def test_the_fitted_order_is_the_declared_one(method: str, system: str) -> None:
    pytest.importorskip("llvmlite")  # minutes otherwise
    few, many = STEPS[method]
    counts = 8 * np.unique(np.geomspace(few / 8, many / 8, 5).astype(int))
    if system == "planet":
        model, start, t_end = planet(), PERIHELION, 3.0
        times = np.linspace(0.0, t_end, 9)
        exact = np.array([position(t) for t in times])
    else:
        model, start, t_end = cart(), ([0.1, 1.0], [0.0, 0.5]), 2.0
        times = np.linspace(0.0, t_end, 9)
        exact = dyn.simulate(model, *start, t_end, "scipy:DOP853", rtol=1e-13, atol=1e-14, t_eval=times).q
    runs = [dyn.simulate(model, *start, t_end, method, dt=t_end / n, t_eval=times) for n in counts.tolist()]
    errors = [np.linalg.norm(run.q - exact) for run in runs]
    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert order == approx(METHODS[method].order, abs=FITTED_ORDER)


@mark.parametrize("method", ADAPTIVE)
def test_the_error_follows_the_tolerance(method: str) -> None:
    pytest.importorskip("llvmlite")
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9, 1e-11):
        run = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=tolerance, atol=tolerance)
        assert run.stats.success
        errors.append(np.abs(run.q[-1] - position(2.5)).max() / tolerance)
    assert max(errors) < 200.0
    assert errors[-1] > 1e-4  # no more accurate than asked for beyond measure


@mark.parametrize("method", [*ADAPTIVE, "scipy:DOP853"])
def test_each_state_may_have_an_absolute_tolerance_of_its_own(method: str) -> None:
    """A small state that oscillates is only resolved by a tolerance of its own."""
    pytest.importorskip("scipy")
    small = 1e-9
    system = dyn.OdeSystem(lambda x, t: [cg.cos(t), small * cg.cos(40.0 * t) + 0.0 * x[0]], ["x", "y"])

    def error(atol: Any) -> float:
        run = dyn.simulate(system, [0.0, 0.0], None, 3.0, method, rtol=1e-30 if ours else 1e-13, atol=atol)
        return float(abs(run.q[-1, 1] / small - math.sin(120.0) / 40.0))

    ours = method in ADAPTIVE
    assert error([1e-6, 1e-6 * small]) < 1e-4
    assert error([1e-6, 1e-6]) > 1e-4


@mark.parametrize("method", ADAPTIVE)
def test_one_absolute_tolerance_is_the_same_for_each_state(method: str) -> None:
    runs = [
        dyn.simulate(planet(), *PERIHELION, 1.0, method, rtol=1e-6, atol=atol, backend="python")
        for atol in (1e-7, [1e-7] * 4)
    ]
    assert np.array_equal(runs[0].q, runs[1].q)


@mark.parametrize("method", ADAPTIVE)
def test_dense_output_is_as_good_as_the_steps(method: str) -> None:
    pytest.importorskip("llvmlite")
    times = np.linspace(0.0, 2.5, 301)
    run = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=1e-9, atol=1e-9, t_eval=times)
    plain = dyn.simulate(planet(), *PERIHELION, 2.5, method, rtol=1e-9, atol=1e-9)
    assert run.t.tolist() == times.tolist()
    assert run.stats.steps == plain.stats.steps
    error = np.abs(run.q - [position(t) for t in times]).max()
    at_steps = np.abs(plain.q - [position(t) for t in plain.t]).max()
    assert error < 30.0 * at_steps + 1e-9
    assert run.q[-1].tolist() == plain.q[-1].tolist()


@mark.parametrize("method", METHODS)
def test_both_back_ends_take_the_same_steps(method: str) -> None:
    pytest.importorskip("llvmlite")
    options: dict[str, Any] = {"dt": 0.05} if method in FIXED else {"rtol": 1e-5}
    runs = [
        dyn.simulate(cart(), [0.1, 1.0], [0.0, 0.5], 0.5, method, backend=each, **options)
        for each in ("llvm", "python")
    ]
    assert runs[0].stats.steps == runs[1].stats.steps
    # An estimate is a difference of nearly equal numbers: rounding moves the steps a little.
    assert runs[0].q == approx(runs[1].q, abs=1e-13 if method in FIXED else 1e-6)
    assert runs[0].q[-1] == approx(runs[1].q[-1], abs=1e-10)
    assert runs[0].stats.nfev == approx(runs[1].stats.nfev, abs=30)  # rounding decides when turns end


@mark.parametrize("tableau", [DOPRI5, DOP853], ids=["dopri5", "dop853"])
def test_an_embedded_tableau_is_consistent(tableau: Tableau) -> None:
    stages = len(tableau.b)
    for row, c in zip(tableau.a, tableau.c, strict=True):
        assert math.fsum(row) == approx(c, abs=1e-14)
    for c, row in tableau.extra:
        assert math.fsum(row) == approx(c, abs=1e-14)
    for power in range(1, tableau.order + 1):  # the quadrature conditions
        assert math.fsum(b * c ** (power - 1) for b, c in zip(tableau.b, tableau.c, strict=True)) == approx(
            1 / power, abs=1e-14
        )
    for error in tableau.error:  # an estimate measures no constant rate
        assert math.fsum(error) == approx(0.0, abs=1e-14)
        assert len(error) == stages + 1
    dense = np.array(tableau.dense)
    assert dense.sum(axis=1)[:stages] == approx(np.array(tableau.b), abs=1e-12)  # at s = 1 the step
    assert dense.sum(axis=1)[stages:] == approx(0.0, abs=1e-12)
    nodes = np.array([*tableau.c, 1.0, *(c for c, _ in tableau.extra)])
    for power in range(4):  # x_dot = t^power is followed exactly inside the step
        follows = dense.T @ nodes**power
        assert follows == approx(np.eye(len(follows))[power] / (power + 1), abs=1e-11)


@mark.parametrize("method", [SYMPLECTIC_EULER, VERLET, MIDPOINT, GAUSS4, GAUSS6])
def test_a_partitioned_method_is_symplectic(method: Partitioned) -> None:
    """Hairer, Lubich and Wanner, theorem VI.4.6: w_i b_ij + w_j a_ji = w_i w_j."""
    a, b, w = np.array(method.a), np.array(method.b), np.array(method.w)
    assert abs(w[:, None] * b + (w[:, None] * a).T - np.outer(w, w)).max() < Fraction(1, 10**38)
    assert method.c == tuple(a.sum(axis=1))


def test_the_numbers_of_radau() -> None:
    t, inverse = np.array(_T), np.array(_T_INVERSE)
    block = inverse @ np.linalg.inv(_A) @ t
    assert t @ inverse == approx(np.eye(3), abs=1e-14)
    assert block[0, 1:] == approx(0.0, abs=1e-13)
    assert block[1:, 0] == approx(0.0, abs=1e-13)
    assert block[1, 1] == approx(block[2, 2], rel=1e-13)
    assert block[1, 2] == approx(-block[2, 1], rel=1e-13)
    c = _A.sum(axis=1)
    assert np.array(_POWERS).T @ [c, c**2, c**3] == approx(np.array(_POWERS).T @ [c, c**2, c**3])
    for power in range(3):  # the polynomial through Z = s^(power + 1) is that power
        assert np.array(_POWERS) @ c ** (power + 1) == approx(np.eye(3)[power], abs=1e-12)


def _power(power: int, x: Any, t: cg.Node) -> list[cg.Node]:
    return [t ** float(power)]


def test_the_numbers_of_rodas() -> None:
    """The stability function of an L-stable method vanishes at infinity; x_dot = t^k is integrated to its order."""
    pytest.importorskip("llvmlite")
    assert RODAS5P.order == 5
    stiff = dyn.OdeSystem(lambda x, t: [-1e12 * x[0]], ["x"])
    run = dyn.simulate(stiff, [1.0], None, 1.0, "rodas", rtol=1e3, atol=1e3, first_step=1.0)
    assert run.stats.steps == 1
    assert abs(run.q[-1, 0]) < 1e-9
    for power in range(5):
        ramp = dyn.OdeSystem(partial(_power, power), ["x"])
        run = dyn.simulate(ramp, [0.0], None, 1.0, "rodas", rtol=1e3, atol=1e3, first_step=1.0)
        assert run.q[-1, 0] == approx(1.0 / (power + 1), abs=1e-11), power


@mark.parametrize("method", ["symplectic_euler", "verlet", "midpoint", "gauss4", "gauss6"])
def test_a_symplectic_step_keeps_area(method: str) -> None:
    """The map (q, p) of one step, by central differences, has J^T S J = S."""
    pytest.importorskip("llvmlite")
    arm = dyn.planar_arm([1.0, 0.7], [0.9, 0.6])
    problem = derive(arm, {"tau0": 0.0, "tau1": 0.0})
    momentum, n = mechanics(problem).momentum, 2

    def p_of(q: Any, qd: Any) -> Any:
        return np.array(list(momentum.evaluate(dict(zip(momentum.input_names, [*q, *qd, 0.0], strict=True))).values()))

    start_q, start_qd = np.array([0.7, -0.4]), np.array([0.3, 0.9])
    mass = np.array([p_of(start_q, each) for each in np.eye(n)]).T

    def step(z: Any) -> Any:
        q = z[:n]
        local = np.array([p_of(q, each) for each in np.eye(n)]).T
        run = dyn.simulate(arm, q, np.linalg.solve(local, z[n:]), 0.05, method, dt=0.05)
        return np.concatenate([run.q[-1], p_of(run.q[-1], run.qd[-1])])

    z = np.concatenate([start_q, mass @ start_qd])
    h = 1e-4
    jacobian = np.array([(step(z + h * e) - step(z - h * e)) / (2 * h) for e in np.eye(2 * n)]).T
    form = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
    assert jacobian.T @ form @ jacobian == approx(form, abs=3e-7)


def test_euler_is_not_symplectic_by_the_same_measure() -> None:
    pytest.importorskip("llvmlite")
    with raises(AssertionError):
        test_a_symplectic_step_keeps_area("euler")


@mark.parametrize("method", ["verlet", "gauss4"])
def test_a_symplectic_run_has_no_drift_of_energy(method: str) -> None:
    pytest.importorskip("llvmlite")
    run = dyn.simulate(planet(), *PERIHELION, 400.0, method, dt=0.02)
    error = run.energy - run.energy[0]
    first, last = (np.abs(part).max() for part in (error[:5000], error[-5000:]))
    assert last < 1.05 * first


def test_a_start_from_rest_does_not_fool_the_first_step() -> None:
    """By symmetry in time some estimates vanish there; two half steps against the whole one do not."""
    pytest.importorskip("llvmlite")
    scene = dyn.scenes.load("triple_pendulum")
    reference = dyn.simulate(scene, scene.q, scene.qd, 0.2, "gauss6", dt=1e-4)
    for method in ("dopri5", "dop853", "radau", "rodas"):
        run = dyn.simulate(scene, scene.q, scene.qd, 0.2, method, rtol=1e-11, atol=1e-11)
        assert run.q[-1] == approx(reference.q[-1], abs=2e-10)
        first = dyn.simulate(scene, scene.q, scene.qd, float(run.t[1]), "gauss6", dt=1e-4)
        assert run.q[1] == approx(first.q[-1], abs=1e-11)


@mark.parametrize("method", [*ADAPTIVE, "rk4", "verlet"])
def test_events_are_found_where_they_are(method: str) -> None:
    pytest.importorskip("llvmlite")
    crossing = dyn.Event("axis", lambda q, qd, t: q[1])
    upward = dyn.Event("upward", lambda q, qd, t: q[1], direction=1)
    late = dyn.Event("late", lambda q, qd, t: t - 11.0, terminal=True)
    run = dyn.simulate(
        planet(),
        *PERIHELION,
        20.0,
        method,
        rtol=1e-11,
        atol=1e-11,
        **step(method, 1e-3),
        events=[crossing, upward, late],
    )
    tolerance = 2e-5 if method == "verlet" else 1e-8
    assert run.events["axis"].t == approx(np.pi * np.arange(1, 4), abs=tolerance)
    assert run.events["upward"].t == approx([2 * np.pi], abs=tolerance)
    assert run.events["axis"].q[0] == approx([-1.0 - ECCENTRICITY, 0.0], abs=tolerance)
    assert (run.t[-1], run.stats.message) == (approx(11.0, abs=1e-12), "event 'late' at t = 11 s")
    assert run.q[-1] == approx(position(11.0 - 2 * np.pi), abs=tolerance)
    assert not run.stats.success


def test_an_event_between_the_times_asked_for() -> None:
    ground = dyn.Event("ground", lambda q, qd, t, p: q[0] - p["floor"], terminal=True)
    ball = System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"], {"floor": 0.5})
    for method in ("rk4", "dop853"):
        run = dyn.simulate(ball, [1.0], [0.0], 1.0, method, **step(method, 0.01), t_eval=[0.0, 0.3, 0.9], events=ground)
        assert run.t.tolist() == [0.0, 0.3]
        assert run.events["ground"].t == approx([math.sqrt(2 * 0.5 / 9.81)], rel=1e-12)
        assert run.events["ground"].qd[0] == approx([-math.sqrt(2 * 9.81 * 0.5)], rel=1e-12)


def test_a_run_that_its_steps_cannot_follow_says_so() -> None:
    pytest.importorskip("llvmlite")
    blow = dyn.OdeSystem(lambda x, t: [x[0] * x[0], 0.0], ["wild", "calm"])
    for method in ADAPTIVE:
        run = dyn.simulate(blow, [1.0, 1.0], None, 2.0, method)
        assert not run.stats.success
        assert run.stats.message.startswith("stopped at t = 1 s: ")
        assert "state 'wild'" in run.stats.message
        assert run.t[-1] == approx(1.0, abs=1e-6)
    turns = dyn.simulate(cart(), [0.1, 3.0], [0.0, 90.0], 1.0, "gauss4", dt=0.5)
    assert "did not converge; the step is too long" in turns.stats.message


def test_a_start_whose_rate_is_no_number() -> None:
    root = dyn.OdeSystem(lambda x, t: [1.0, cg.log(x[1])], ["a", "b"])
    run = dyn.simulate(root, [0.0, -1.0], None, 1.0, "dopri5")
    assert (len(run.t), run.stats.message) == (
        1,
        "stopped at t = 0 s: the rate of state 'b' is not finite at the start",
    )


@mark.parametrize("method", ["rk4", "dopri5", "rodas", "scipy:RK45"])
def test_max_steps_ends_a_run(method: str) -> None:
    if method.startswith("scipy"):
        pytest.importorskip("scipy")
    run = dyn.simulate(planet(), *PERIHELION, 50.0, method, **step(method, 0.01), max_steps=17)
    assert (len(run.t), run.stats.steps, run.stats.success) == (
        18 - run.stats.rejected,
        17 - run.stats.rejected,
        False,
    )
    assert run.stats.message.endswith("after max_steps = 17 steps")


@mark.parametrize("method", ADAPTIVE)
def test_max_step_is_the_longest_step_and_the_end_is_met(method: str) -> None:
    run = dyn.simulate(planet(), *PERIHELION, 1.0, method, max_step=0.13)
    assert np.diff(run.t).max() <= 0.13 * (1 + 1e-12)
    assert run.stats.dt <= 0.13
    assert run.t[-1] == 1.0


def test_systems_of_first_order() -> None:
    turning = dyn.OdeSystem(lambda x, t, p: [p["w"] * x[1], -p["w"] * x[0]], ["a", "b"], {"w": 2.0})
    for method in (*ADAPTIVE, "rk4", "midpoint", "gauss4", "gauss6", "euler"):
        run = dyn.simulate(turning, [1.0, 0.0], None, 1.0, method, **step(method, 1e-3))
        assert run.q[-1] == approx([math.cos(2.0), -math.sin(2.0)], abs=5e-3 if method == "euler" else 1e-5)
        assert run.qd.shape == (len(run.t), 0)
        assert np.isnan(run.energy).all()
    for method in ("verlet", "symplectic_euler"):
        with raises(ValueError, match="a system of first order has none"):
            dyn.simulate(turning, [1.0, 0.0], None, 1.0, method)
    with raises(ValueError, match="qd must be None for a system of first order"):
        dyn.simulate(turning, [1.0, 0.0], [], 1.0)


def test_a_momentum_that_is_not_linear_in_the_velocity() -> None:
    """A relativistic oscillator, L = -sqrt(1 - v^2) - x^2 / 2: p = v / sqrt(1 - v^2)."""
    pytest.importorskip("llvmlite")
    system = System(lambda q, qd, t: -cg.sqrt(1.0 - qd[0] ** 2) - 0.5 * q[0] ** 2, ["x"])
    fine = dyn.simulate(system, [3.0], [0.0], 8.0, "dop853", rtol=1e-12, atol=1e-12)
    for method, tolerance in (("gauss6", 1e-9), ("gauss4", 1e-7), ("verlet", 1e-3), ("midpoint", 1e-3)):
        run = dyn.simulate(system, [3.0], [0.0], 8.0, method, dt=0.01)
        assert run.q[-1] == approx(fine.q[-1], abs=tolerance)
        assert np.ptp(run.energy) < 30 * tolerance


def test_a_driven_system() -> None:
    """x'' = -x + cos 2t from rest at 0: x = (cos t - cos 2t) / 3."""
    pytest.importorskip("llvmlite")
    driven = System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2 + q[0] * cg.cos(2.0 * t), ["x"])
    exact = (math.cos(3.0) - math.cos(6.0)) / 3.0
    for method in METHODS:
        run = dyn.simulate(driven, [0.0], [0.0], 3.0, method, **step(method, 1e-3), rtol=1e-10, atol=1e-10)
        assert run.q[-1, 0] == approx(exact, abs={1: 2e-3, 2: 1e-5}.get(METHODS[method].order, 1e-8)), method


@mark.parametrize("solver", ["Radau", "BDF", "LSODA", "DOP853", "RK45"])
def test_solvers_of_scipy(solver: str) -> None:
    pytest.importorskip("scipy")
    times = [0.0, 0.4, 1.1, 2.5]
    run = dyn.simulate(planet(), *PERIHELION, 2.5, f"scipy:{solver}", rtol=1e-8, atol=1e-8, t_eval=times)
    assert run.q == approx(np.array([position(t) for t in times]), abs=3e-6)
    assert (run.stats.success, run.stats.method) == (True, f"scipy:{solver}")
    every = dyn.simulate(planet(), *PERIHELION, 2.5, f"scipy:{solver}")
    assert len(every.t) == every.stats.steps + 1
    with raises(ValueError, match=r"SciPy's methods are scipy:Radau, .*, got 'scipy:Nothing'"):
        dyn.simulate(planet(), *PERIHELION, 2.5, "scipy:Nothing")


def test_tolerances_out_of_range_are_refused() -> None:
    for options, message in (
        ({"rtol": -1.0}, "rtol and atol must be finite"),
        ({"rtol": 0.0, "atol": 0.0}, "not both 0"),
        ({"atol": math.nan}, "rtol and atol"),
        ({"atol": [1e-9, 1e-9, 1e-9, -1.0]}, "rtol and atol"),
        ({"rtol": 0.0, "atol": [1e-9, 1e-9, 0.0, 1e-9]}, "not both 0"),
        ({"atol": [1e-9, 1e-9]}, r"shape \(4,\), one for each of q0, q1, qd0, qd1; got \(2,\)"),
        ({"first_step": 0.0}, "first_step must be positive and finite, got 0.0 s"),
        ({"max_steps": 0}, "max_steps must be a whole number, at least 1, or infinite, got 0"),
        ({"events": [dyn.Event("e", lambda q, qd, t: 1.0)]}, "event 'e' must be a node of the state"),
        ({"events": [dyn.Event("e", lambda q, qd, t: cg.variable("z"))]}, "event 'e' must be a node of the state"),
    ):
        with raises(ValueError, match=message):
            dyn.simulate(planet(), *PERIHELION, 1.0, "dopri5", **options)  # type: ignore[arg-type]
    with raises(ValueError, match="direction must be 1, -1 or 0, got 2"):
        dyn.Event("e", lambda q, qd, t: q[0], direction=2)
    with raises(ValueError, match="two events have the name 'e'"):
        dyn.simulate(planet(), *PERIHELION, 1.0, events=[dyn.Event("e", lambda q, qd, t: q[0])] * 2)


def test_steps_grow_and_shrink_within_limits() -> None:
    run = dyn.simulate(planet(), *PERIHELION, 10.0, "dopri5")
    ratios = [after / before for before, after in itertools.pairwise(np.diff(run.t)[:-2])]
    assert max(ratios) <= 5.0 * (1 + 1e-12)


@mark.parametrize("method", ["dop853", "dopri5", "rk4", "radau", "gauss6"])
def test_two_crossings_in_one_step_are_both_found(method: str) -> None:
    """x = sin t touches 0.999 and goes back 0.09 s later; steps are longer."""
    circle = dyn.OdeSystem(lambda x, t: [x[1], -x[0]], ["x", "v"])
    over = dyn.Event("over", lambda x, t: x[0] - 0.99)
    steps = {"rk4": {"dt": 0.1}, "gauss6": {"dt": 0.2}}.get(method, {})
    run = dyn.simulate(circle, [0.0, 1.0], None, 10.0, method, **steps, rtol=1e-9, atol=1e-9, events=[over])
    peak = np.arccos(0.99)
    expected = [turn * 2.0 * np.pi + 0.5 * np.pi + side * peak for turn in (0, 1) for side in (-1, 1)]
    assert run.events["over"].t == approx(expected, abs=2e-4 if method in ("rk4", "gauss6") else 1e-6)


def test_an_event_is_what_it_says() -> None:
    with raises(TypeError, match="an event needs a name, a function, and True or False for `terminal`, got 'e', 1"):
        dyn.Event("e", 1)  # type: ignore[arg-type]
    with raises(TypeError, match="True or False for `terminal`"):
        dyn.Event("e", lambda q, qd, t: q[0], terminal="no")  # type: ignore[arg-type]


BOGACKI_SHAMPINE = Tableau(
    3,
    c=(0, 1 / 2, 3 / 4),
    a=((), (1 / 2,), (0, 3 / 4)),
    b=(2 / 9, 1 / 3, 4 / 9),
    error=((5 / 72, -1 / 12, -1 / 9, 1 / 8),),
    estimate=3,
)  # Applied Mathematics Letters 2 (1989) 321
RALSTON = Tableau(2, c=(0, 2 / 3), a=((), (2 / 3,)), b=(1 / 4, 3 / 4))


def test_a_tableau_alone_is_a_method_of_equal_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "ralston", runge_kutta(RALSTON))
    ends = [dyn.simulate(planet(), *PERIHELION, 1.0, "ralston", dt=h).q[-1] for h in (1e-2, 5e-3)]
    errors = [np.abs(end - position(1.0)).max() for end in ends]
    assert math.log2(errors[0] / errors[1]) == approx(RALSTON.order, abs=FITTED_ORDER)


def test_a_tableau_with_an_estimate_chooses_its_steps_and_has_dense_output(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "bs23", runge_kutta(BOGACKI_SHAMPINE))
    options: dict[str, Any] = {"rtol": 1e-8, "atol": 1e-8, "backend": "auto"}
    plain = dyn.simulate(planet(), *PERIHELION, 1.0, "bs23", **options)
    times = np.linspace(0.0, 1.0, 101)
    dense = dyn.simulate(planet(), *PERIHELION, 1.0, "bs23", t_eval=times, **options)
    assert dense.stats.steps == plain.stats.steps < 2000
    at_steps = np.abs(plain.q - [position(t) for t in plain.t]).max()
    assert at_steps < 1e-6
    assert np.abs(dense.q - [position(t) for t in times]).max() < 2.0 * at_steps
    many = dyn.simulate_many(planet(), [PERIHELION[0]] * 3, PERIHELION[1], 1.0, "bs23", t_eval=times, **options)
    assert np.array_equal(many.q[1], dense.q)
