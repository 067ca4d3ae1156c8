"""Controllers: in closed form, as forces of the system; and sampled, held over periods."""

import math
import pickle
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from dynamics.integrators import derive
from tests.dynamics.models import Array
from tests.dynamics.step_options import ADAPTIVE, EVERY_METHOD, step

RUN_ERROR = 1e-8  # of runs at rtol 1e-9 and less, or of fourth order at 2 ms
START: dict[str, Any] = {"q": [0.4, -0.2], "qd": [0.0, 0.1]}
GAINS = {"kp": 20.0, "kd": 3.0}


def servo(q: Any, qd: Any, t: Any, p: Any) -> list[Any]:
    """PD control of the first coordinate to a moving target, and of the second to 0."""
    return [p["kp"] * (0.2 * cg.sin(3.0 * t) - q[0]) - p["kd"] * qd[0], -p["kp"] * q[1] - p["kd"] * qd[1]]


def springs(forces: Any = None, parameters: Any = None, scale: float = 1.0) -> dyn.System:
    """Two unlike masses between springs, with frequencies of 1 to 3 rad in scale seconds."""

    def lagrangian(q: Any, qd: Any, t: Any) -> cg.Node:
        kinetic = 0.5 * qd[0] ** 2 + 0.25 * qd[1] ** 2
        return kinetic - (q[0] ** 2 + 0.75 * (q[1] - q[0]) ** 2) * (0.5 / scale**2)

    return dyn.System(lagrangian, ["a", "b"], parameters, forces)


SPRINGS = springs()


@mark.parametrize("method", ["dop853", "taylor", "radau", "rk4", "verlet"])
def test_a_controller_in_closed_form_is_a_force_of_the_system(method: str) -> None:
    """Bit for bit, with events and between the rows."""
    options = {"events": dyn.Event("passing", lambda q, qd, t: q[0] - 0.25), "dense_output": True, **step(method, 0.02)}
    written = dyn.simulate(springs(servo, GAINS), **START, t_end=0.5, method=method, **options)
    given = dyn.simulate(SPRINGS, **START, t_end=0.5, method=method, tau=servo, parameters=GAINS, **options)
    for name in ("t", "q", "qd", "qdd", "energy", "forces"):
        assert (getattr(given, name) == getattr(written, name)).all(), name
    assert (given.events["passing"].t == written.events["passing"].t).all()
    assert len(given.events["passing"].t)
    assert (np.array(given.solution(0.3)) == np.array(written.solution(0.3))).all()
    assert (given.tau == given.forces).all()
    assert not written.tau.any()


def test_gains_of_a_controller_are_parameters_of_every_run() -> None:
    kp = np.array([20.0, 5.0])
    tau = {"tau": servo, "t_eval": [0.5]}
    several = dyn.simulate_many(SPRINGS, **START, t_end=0.5, parameters={"kp": kp, "kd": 3.0}, **tau)
    for row, gain in zip(several.q, kp, strict=True):
        alone = dyn.simulate(SPRINGS, **START, t_end=0.5, parameters={"kp": gain, "kd": 3.0}, **tau)
        assert row == approx(alone.q, abs=RUN_ERROR)
    system = dyn.with_controller(SPRINGS, servo, GAINS)
    assert dyn.simulate(system, **START, t_end=0.5, t_eval=[0.5]).q == approx(several.q[0], abs=RUN_ERROR)
    assert dyn.state_equation(system).input_names[-3:] == ("t", "kp", "kd")


def test_the_same_controller_is_derived_once() -> None:
    model = SPRINGS
    first, second = (dyn.with_controller(model, lambda q, qd, t: [-q[0], 0.0]) for _ in range(2))
    other = dyn.with_controller(model, lambda q, qd, t: [-2.0 * q[0], 0.0])
    assert derive(first, {}) is derive(second, {})
    assert derive(first, {}) is not derive(other, {})


def test_the_reference_takes_a_controller() -> None:
    tau = {"tau": servo, "parameters": GAINS}
    exact = dyn.reference(SPRINGS, **START, t_eval=[0.25], digits=12, **tau)
    run = dyn.simulate(SPRINGS, **START, t_end=0.25, rtol=1e-12, **tau)
    assert run.q[-1] == approx([float(text) for text in exact.decimal[0][:2]], abs=RUN_ERROR)


@mark.parametrize(
    ("tau", "parameters", "message"),
    [
        (servo, {}, "no parameter 'kp'"),
        (servo, {**GAINS, "ki": 1.0}, "parameter 'ki'"),
        (lambda q, qd, t: [0.0], None, "must give 2 values"),
        (lambda q, qd, t: [cg.variable("z"), 0.0], None, "uses 'z'"),
    ],
)
def test_a_controller_that_does_not_fit_is_refused(tau: Any, parameters: Any, message: str) -> None:
    with raises(ValueError, match=message):
        dyn.simulate(SPRINGS, **START, t_end=1.0, tau=tau, parameters=parameters)


def discretized(period: float) -> tuple[Array, Array]:
    """Of the springs with a held force, x(t + period) = A x(t) + B u, by the matrix exponential."""
    a, b = dyn.linearize(SPRINGS, [0.0, 0.0], [0.0, 0.0])
    step = np.vstack([np.hstack([a, b]), np.zeros((2, 6))]) * period
    total, term = np.eye(6), np.eye(6)
    for k in range(1, 30):
        term = term @ step / k
        total = total + term
    return total[:4, :4], total[:4, 4:]


GAIN = np.array([[8.0, 0.0, 2.0, 0.0], [0.0, 8.0, 0.0, 2.0]])
ERRORS = {1: 0.02, 2: 1e-4}  # of first and second order at 2 ms; higher ones to RUN_ERROR


class Regulator:
    """u = -GAIN x, which notes when it was called."""

    def __init__(self) -> None:
        self.calls: list[float] = []

    def __call__(self, q: Array, qd: Array, t: float) -> Array:
        self.calls.append(t)
        return -GAIN @ np.concatenate([q, qd])


@mark.parametrize("method", EVERY_METHOD)
def test_held_forces_give_the_exact_discretization_of_a_linear_system(method: str) -> None:
    """At the ends of periods and between, by one call a period."""
    period, regulator = 0.1, Regulator()
    options = {"tau": dyn.SampledController(regulator, period), "dense_output": True}
    run = dyn.simulate(SPRINGS, **START, t_end=1.0, method=method, **options, **step(method, 2e-3, rtol=1e-10))
    assert run.held is not None
    assert regulator.calls == run.held.t.tolist() == approx([k * period for k in range(10)])
    error = ERRORS.get(METHODS[method].order, RUN_ERROR)
    a, b = discretized(period)
    a_half, b_half = discretized(0.5 * period)
    x = np.array([*START["q"], *START["qd"]])
    for t in run.held.t:
        row, u = int(np.searchsorted(run.t, t)), -GAIN @ x
        assert run.t[row] == t
        assert np.concatenate([run.q[row], run.qd[row]]) == approx(x, abs=error)
        assert run.tau[row] == approx(u, abs=10.0 * error)
        assert np.concatenate(run.solution(t + 0.5 * period)) == approx(a_half @ x + b_half @ u, abs=error)
        x = a @ x + b @ u
    assert run.t[-1] == 1.0
    assert np.concatenate([run.q[-1], run.qd[-1]]) == approx(x, abs=error)
    assert (run.forces == run.tau).all()
    assert (pickle.loads(pickle.dumps(run)).tau == run.tau).all()


@mark.parametrize("method", [*ADAPTIVE, "rk4"])
@mark.parametrize("period", [0.1, 1.0 / 3.0, 0.07])
def test_steps_end_where_periods_do_and_all_move(method: str, period: float) -> None:
    """Also where times to record, the end, and an end of a period differ by rounding."""
    times = [0.1 * k for k in range(1, 11)]
    controller = dyn.SampledController(lambda q, qd, t: [-q[0], 0.0], period)
    limit = {} if method == "rk4" else {"first_step": 1.0}
    every = dyn.simulate(SPRINGS, **START, t_end=1.0, method=method, tau=controller, **limit)
    chosen = dyn.simulate(SPRINGS, **START, t_end=1.0, method=method, tau=controller, t_eval=times, **limit)
    assert every.held is not None
    assert chosen.held is not None
    assert len(chosen.held.t) == len(every.held.t) == math.ceil(1.0 / period - 1e-9)
    assert set(every.held.t.tolist()) <= set(every.t.tolist())
    assert np.diff(every.t).min() > 1e-9  # of periods of 70 ms, none is cut to a rounding
    assert chosen.success
    assert chosen.t.tolist() == times


@mark.parametrize("method", ["dop853", "radau", "rk4"])
def test_a_reset_leaves_held_forces_and_periods_as_they_are(method: str) -> None:
    regulator = Regulator()
    bounce = dyn.Event("bounce", lambda q, qd, t: q[0] - 0.25, reset=lambda q, qd, t: (q, [-qd[0], qd[1]]))
    controller = dyn.SampledController(regulator, 0.1)
    run = dyn.simulate(SPRINGS, **START, t_end=1.0, method=method, events=bounce, tau=controller)
    assert run.held is not None
    assert run.success
    instants = run.events["bounce"].t
    assert len(instants) > 1
    assert not np.isin(instants, regulator.calls).any()
    assert regulator.calls == approx([0.1 * k for k in range(10)])
    assert (run.q[:, 0] > 0.25 - RUN_ERROR).all()
    for t in instants:
        rows = np.flatnonzero(run.t == t)
        assert len(rows) == 2
        assert (run.tau[rows] == run.held.tau[int(t / 0.1)]).all()


def test_the_error_of_a_sampled_controller_is_not_estimated() -> None:
    tau = dyn.SampledController(Regulator(), 0.1)
    run = dyn.simulate(SPRINGS, **START, t_end=1.0, method="rk4", dt=0.1, tau=tau)
    assert run.stats.error is run.stats.error_at_end is None
    with raises(ValueError, match="run again with half of dt and compare"):
        dyn.simulate(SPRINGS, **START, t_end=1.0, method="rk4", dt=0.1, tau=tau, estimate_error=True)


def test_what_a_controller_raises_says_when() -> None:
    def control(q: Array, qd: Array, t: float) -> Any:
        return [1.0 / (0.25 - t), 0.0] if t < 0.5 else [0.0]

    for period, error in ((0.25, ZeroDivisionError), (0.5 / 3.0, ValueError)):
        with raises(error) as caught:
            dyn.simulate(SPRINGS, **START, t_end=1.0, tau=dyn.SampledController(control, period))
        where = 0.25 if error is ZeroDivisionError else 0.5
        assert caught.value.__notes__ == [f"in the controller at t = {where:g} s"]


def test_ctrl_c_in_a_controller_keeps_what_was_run() -> None:
    for last in (0.5, 0.0):

        def control(q: Array, qd: Array, t: float, last: float = last) -> Array:
            if t > last - 0.05:
                raise KeyboardInterrupt
            return -q

        run = dyn.simulate(SPRINGS, **START, t_end=1.0, tau=dyn.SampledController(control, 0.1))
        assert run.message == f"interrupted after t = {last:g} s"
        assert run.t[-1] == last
        assert (run.tau[:-1] == run.forces[:-1]).all()
        assert np.isnan(run.tau).any() == (last == 0.0)


def test_ctrl_c_in_a_prepared_motion_is_raised_with_what_was_run() -> None:
    def control(q: Array, qd: Array, t: float) -> Array:
        if t > 0.45:
            raise KeyboardInterrupt
        return -q

    motion = dyn.prepare(SPRINGS, tau=dyn.SampledController(control, 0.1))
    with raises(KeyboardInterrupt, match=r"interrupted after t = 0\.5 s") as stop:
        motion(**START, t_end=1.0)
    assert stop.value.run.t[-1] == 0.5
    with raises(KeyboardInterrupt):
        motion.end(**START, t_end=1.0)


FIRST_ORDER = dyn.OdeSystem(lambda x, t: [x[0]], ["x"])


@mark.parametrize(
    ("run", "options", "error", "message"),
    [
        (dyn.simulate, {"t0": 2.0}, ValueError, "later than t0"),
        (dyn.simulate, {"model": FIRST_ORDER, "q": [1.0], "qd": None}, TypeError, "first order"),
        (dyn.simulate_many, {"q": [[0.1, 0.2]], "method": "rk4"}, TypeError, "controls one run"),
        *[(dyn.simulate, {"period": p}, ValueError, "period of a controller") for p in (0.0, -1.0, math.nan, math.inf)],
    ],
)
def test_what_cannot_hold_forces_says_so(run: Any, options: dict[str, Any], error: Any, message: str) -> None:
    arguments = {"model": SPRINGS, **START, "t_end": 1.0} | options
    with raises(error, match=message):
        run(**arguments, tau=dyn.SampledController(Regulator(), arguments.pop("period", 0.1)))


def test_a_table_has_the_applied_forces_where_there_are_any() -> None:
    """As NumPy reads it back; none where nothing is applied."""
    hold = dyn.SampledController(lambda q, qd, t: -q, 0.1)
    for tau in (0.0, [1.0, 0.0], lambda q, qd, t: [-q[0], 0.0], hold):
        run = dyn.simulate(SPRINGS, **START, t_end=0.2, t_eval=[0.0, 0.2], tau=tau, backend="python")
        names, *rows = run.to_csv().splitlines()
        applied = [] if tau == 0.0 else [run.tau]
        assert names.split(",")[5:] == ["energy", *(["tau.a", "tau.b"] if applied else [])]
        table = np.loadtxt(rows, delimiter=",")
        assert table.tolist() == np.column_stack([run.t, run.q, run.qd, run.energy, *applied]).tolist()
