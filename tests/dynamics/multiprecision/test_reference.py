"""Reference solutions: Taylor series against closed forms and other integrators."""

import importlib
import math
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import mpmath
import numpy as np
import pytest
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.experiments.work_precision.measurement import problem_of
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.multiprecision import Reference, ReferenceFailedError, reference
from dynamics.systems.ode_system import OdeSystem
from tests.bench.motions.trajectory_peers import heyoka_equations
from tests.dynamics.models import split_state
from tests.dynamics.simulation.test_quasi_velocities import drone
from tests.each_row import each_row
from tests.oracles import closed_forms

FLOAT = 2.0**-53  # half an ulp: what rounding to float64 leaves
BOTH_14, BOTH_20 = 1e-14, 1e-19  # two solutions, of which one has 14 or 20 digits
EXACT = 1e-15  # arcs of parabolas in float64
THIRTY = 1e-29  # two solutions of thirty digits, of which one is off by its stated error
LAST_BITS = 1e-10  # relative, of a difference that float64 holds to ten digits

TIMES = [0.25, 1.0, 9.0]
PENDULUM = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 9.81 * cg.cos(q[0]), ["angle"])
ORBIT = [0.25, 0.0, 0.0, math.sqrt(7.0)]  # e = 0.75
KEPLER = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + 1.0 / cg.hypot(q[0], q[1]), ["x", "y"])


CLOSED: dict[str, tuple[Any, list[float], Reference]] = {
    "exponential": (OdeSystem(lambda x, t: [-0.5 * x[0]], "x"), [2.0], closed_forms.exponential(TIMES, 2.0, -0.5)),
    "oscillator": (
        dyn.System(lambda q, qd, t: qd[0] ** 2 - 1.5 * q[0] ** 2, ["x"], damping=0.25),
        [1.0, -0.5],
        closed_forms.oscillator(TIMES, 1.0, -0.5, 1.5, 0.125),
    ),
    "overdamped": (
        dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 0.5 * q[0] ** 2, ["x"], damping=5.0),
        [1.0, 0.0],
        closed_forms.oscillator(TIMES, 1.0, 0.0, 1.0, 5.0),
    ),
    "pendulum": (PENDULUM, [2.5, 0.0], closed_forms.pendulum(TIMES, 2.5, 9.81)),
    "kepler": (KEPLER, ORBIT, closed_forms.kepler(TIMES, ORBIT)),
    "cosine": (OdeSystem(lambda x, t: [cg.cos(t) - x[0] - cg.sin(t)], "x"), [1.0], closed_forms.cosine(TIMES)),
}


def apart(a: Reference, b: Reference) -> float:
    """The largest difference of two references, relative to the largest value of the state."""
    with mpmath.mp.workdps(60):
        table = [[[mpmath.mpf(each) for each in row] for row in one.decimal] for one in (a, b)]
        columns = zip(zip(*table[0], strict=True), zip(*table[1], strict=True), strict=True)
        return float(
            max(max(abs(p - q) for p, q in zip(*pair, strict=True)) / (max(map(abs, pair[1])) or 1) for pair in columns)
        )


@mark.parametrize("name", CLOSED)
def test_a_reference_is_the_closed_form_within_its_stated_error(name: str) -> None:
    model, start, exact = CLOSED[name]
    found = reference(model, *split_state(model, start), TIMES, digits=24)
    assert found.error <= 1e-24
    assert apart(found, exact) <= found.error + exact.error
    assert found.relative_error(exact.x) <= FLOAT


def test_a_damped_double_pendulum_with_torque_is_that_of_a_simulation() -> None:
    arm, tau = dyn.planar_arm([1.0, 0.5], [1.0, 0.75], damping=[0.1, 0.2]), [0.5, -0.25]
    run = dyn.simulate(arm, [1.0, 2.0], [0.0, -1.0], 1.0, "kahan_li8", dt=0.004, tau=tau, estimate_error=False)
    found = reference(arm, [1.0, 2.0], [0.0, -1.0], [1.0], digits=16, tau=tau)
    assert found.relative_error([[*run.q[-1], *run.qd[-1]]]) < BOTH_14


def bouncing(t: float) -> tuple[float, float]:
    """x'' = -sign(x) from rest at 2: arcs of parabolas, period 8, each quarter lasts 2."""
    rest = t % 8.0
    quarter = min(rest, 8.0 - rest)
    x = 2.0 - 0.5 * quarter**2 if quarter <= 2.0 else -2.0 + 0.5 * (4.0 - quarter) ** 2
    v = -quarter if quarter <= 2.0 else -(4.0 - quarter)
    return x, v if rest < 4.0 else -v


SWITCHING: dict[str, Callable[[Any], Any]] = {
    "sign": cg.sign,
    "where": lambda x: cg.where(x > 0.0, 1.0, -1.0),
    "less_equal": lambda x: 1.0 - 2.0 * (x <= 0.0),
    "abs": lambda x: cg.where(cg.equal(x, 0.0), 1.0, cg.abs(x) / cg.where(cg.equal(x, 0.0), 1.0, x)),
    "maximum": lambda x: 2.0 * (cg.maximum(x, 0.0) > 0.0) - 1.0,
}


@mark.parametrize("name", SWITCHING)
def test_steps_end_where_a_piece_of_the_equation_ends(name: str) -> None:
    system = OdeSystem(lambda x, t: [x[1], -SWITCHING[name](x[0])], "x v")
    times = [1.0, 3.0, 6.5, 13.0]
    found = reference(system, [2.0, 0.0], None, times)
    assert found.error <= 1e-30
    assert found.x == approx(np.array([bouncing(t) for t in times]), rel=0.0, abs=EXACT)


def test_a_start_on_a_kink_takes_the_side_that_the_motion_takes() -> None:
    found = reference(
        OdeSystem(lambda x, t: [-1.0, cg.abs(x[0]) + cg.minimum(x[0], 0.0)], "x y"), [0.0, 0.0], None, [2.0]
    )
    assert found.x[-1].tolist() == [-2.0, 0.0]


def test_a_solution_that_slides_along_a_switch_is_refused() -> None:
    with raises(ReferenceFailedError, match="slides along a switch of its equations at t = 1"):
        reference(OdeSystem(lambda x, t: [-cg.sign(x[0])], "x"), [1.0], None, [2.0], digits=10)


def test_rest_stays_rest() -> None:
    assert reference(PENDULUM, [0.0], [0.0], [1.0, 1e6]).x.tolist() == [[0.0, 0.0]] * 2


def test_start_and_times_between_steps_are_recorded() -> None:
    times = [0.0, 1e-9, 0.1, 0.1 + 1e-9, 0.7]
    found = reference(PENDULUM, [1.0], [0.0], times)
    assert found.decimal[0] == ("1", "0") or found.x[0].tolist() == [1.0, 0.0]
    assert (
        apart(
            found, Reference(tuple(times), (("1", "0"), *closed_forms.pendulum(times[1:], 1.0, 9.81).decimal), 0.0, "")
        )
        < THIRTY
    )


def test_parameters_replace_the_models_own() -> None:
    system = OdeSystem(lambda x, t, p: [p["k"] * x[0]], "x", {"k": 1.0})
    assert reference(system, [1.0], None, [1.0]).x[0, 0] == math.exp(1.0)
    assert reference(system, [1.0], None, [1.0], parameters={"k": -1.0}).x[0, 0] == math.exp(-1.0)


def test_a_singularity_on_the_way_is_an_error_that_says_where() -> None:
    with raises(ReferenceFailedError, match=r"t = (0\.99|1)"):
        reference(OdeSystem(lambda x, t: [x[0] * x[0]], "x"), [1.0], None, [2.0], digits=10)
    with raises(ReferenceFailedError, match="domain"):
        reference(OdeSystem(lambda x, t: [cg.log(x[0])], "x"), [-1.0], None, [2.0], digits=10)


def test_a_motion_that_would_take_a_million_steps_is_refused_after_a_few() -> None:
    fast = OdeSystem(lambda x, t: [x[1], -1e18 * x[0]], ["x", "v"])
    with raises(ReferenceFailedError, match=r"the first 50 steps come to t = .*, so that 1 s would take some .e\+0"):
        reference(fast, [1.0, 0.0], None, [1.0])


def test_the_state_that_does_not_settle_is_named() -> None:
    """As one that is zero but for rounding."""
    module = importlib.import_module("dynamics.multiprecision.reference")

    def run(wanted: int) -> tuple[list[list[Decimal]], str]:
        return [[Decimal(1), Decimal(10) ** -wanted]], ""

    with raises(ReferenceFailedError, match=r"of the largest value of q1, so that it is zero but for rounding"):
        module._converged(run, [2.0], 30, ["q0", "q1"])


def test_deviation_is_told_below_the_rounding_of_the_reference() -> None:
    third = Reference((1.0,), (("0." + "3" * 40,),), 1e-40, "")
    value = 1.0 / 3.0
    with mpmath.mp.workdps(40):
        assert third.deviation([[value]])[0, 0] == approx(float(mpmath.mpf(value) - mpmath.mpf(1) / 3), rel=LAST_BITS)
    assert third.relative_error([[value]]) < FLOAT
    with raises(ValueError, match=r"shape \(1, 1\)"):
        third.deviation([[1.0, 2.0]])


@each_row(
    ("changed", "words"),
    [
        ({"q": [1.0, 2.0]}, r"q must have shape \(1,\), one for each coordinate, got \(2,\)"),
        ({"qd": [math.nan]}, "qd must be finite, got .nan"),
        ({"qd": None}, r"qd must have shape \(1,\), one for each coordinate, got None"),
        ({"t_eval": []}, "t_eval must be increasing times from 0 s on"),
        ({"t_eval": [1.0, 1.0]}, "t_eval must be increasing"),
        ({"parameters": {"k": 1.0}}, r"the system has no parameter k \(it has none\)"),
        ({"tau": [1.0, 2.0]}, "tau needs one number"),
    ],
)
def test_wrong_input_is_named(changed: dict[str, Any], words: str) -> None:
    with raises(ValueError, match=words):
        reference(**{"model": PENDULUM, "q": [1.0], "qd": [0.0], "t_eval": [1.0]} | changed)


QUADRUPLE = 1e-29  # 33 digits, and what rounding adds up to over the steps


def test_heyoka_has_the_same_triple_pendulum_to_29_digits() -> None:
    """By its Taylor integrator in quadruple precision, from the same graph: series of its own."""
    hy = pytest.importorskip("heyoka")
    if not hasattr(hy, "real128"):
        pytest.skip("this heyoka has no quadruple precision")
    task, real = load("triple_pendulum"), hy.real128
    start = [real(each) for each in task.start]
    equations = heyoka_equations(hy, problem_of(task), real)
    run = hy.taylor_adaptive(equations, start, fp_type=real, tol=real(1e-33), compact_mode=True)
    run.propagate_until(real(0.5))
    found = reference(task, task.q, task.qd, [0.5], digits=29)
    assert apart(found, Reference((0.5,), (tuple([str(each) for each in run.state]),), QUADRUPLE, "")) < QUADRUPLE


def test_a_free_rotor_is_jacobis_and_any_mechanism_of_spatial_joints_has_a_reference() -> None:
    moments, omega = (1.0, 2.0, 3.0), [0.1, 1.0, 0.2]
    rotor = dyn.Body("rotor", dyn.Joint("ball"), mass=1.0, inertia=np.diag(moments))
    turning = reference(dyn.Mechanism([rotor], gravity=(0, 0, 0)), [1.0, 0.0, 0.0, 0.0], omega, TIMES, digits=20)
    exact = closed_forms.free_rigid_body(TIMES, moments, omega)
    here = Reference(turning.t, tuple([row[4:] for row in turning.decimal]), turning.error, turning.how)
    assert np.abs(here.deviation(exact.x) - exact.deviation(exact.x)).max() < BOTH_20
    start = [0.0, 0.0, 1.0, 2.0, 0.2, 0.3, 0.1, 0.4], [0.5, 0.0, 2.0, 0.3, 0.2, 1.0, -2.0]
    run = dyn.simulate(drone(), *start, 0.5, "gauss6", dt=0.005, estimate_error=False)
    found = reference(drone(), *start, [0.5], digits=16)
    assert found.relative_error([[*run.q[-1], *run.qd[-1]]]) < BOTH_14
