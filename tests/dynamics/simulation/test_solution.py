"""What a trajectory knows besides its rows: the motion between them, accelerations and forces."""

import pickle
from typing import Any

import numpy as np
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import METHODS
from tests.dynamics.models import oscillator, random_arm
from tests.dynamics.step_options import LIKE_OTHERS, step
from tests.slow import slow

FREQUENCY = np.sqrt(1.5)  # rad/s, of the oscillator
BETWEEN = {"bs23": 1e-3, "euler": 0.1, "symplectic_euler": 0.05, "verlet": 1e-3, "midpoint": 1e-3}  # at 0.02 s
CUBIC = 1e-5  # of a cubic through steps of 0.02 s, and of steps within 1e-9
ROUNDING = 1e-12


def pulled() -> dyn.System:
    """Two masses on springs, one of them pulled, both in a liquid."""
    return dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + 2.0 * qd[1] ** 2) - 0.5 * q[0] ** 2 - 0.5 * (q[1] - q[0]) ** 2,
        ["x", "y"],
        forces=lambda q, qd, t: [cg.sin(3.0 * t), -q[1] * qd[0]],
        damping=[0.1, 0.2],
    )


@mark.parametrize(
    ("method", "t_eval"),
    [
        *((method, [0.1, 0.5, 1.7]) for method in METHODS if method not in LIKE_OTHERS),
        *(("rk4", None), ("dop853", None)),
        *slow(*[(method, [0.1, 0.5, 1.7]) for method in LIKE_OTHERS]),
    ],
)
def test_a_solution_is_the_motion(method: str, t_eval: Any) -> None:
    options: dict[str, Any] = {"t_eval": t_eval, "backend": "python", **step(method, 0.02)}
    run = dyn.simulate(oscillator(), [1.0], [0.0], 2.0, method, dense_output=True, **options)
    q, qd = run.solution(run.t)
    assert (q == run.q).all()
    assert (qd == run.qd).all()
    times = np.linspace(0.0, 2.0, 37)
    q, qd = run.solution(times)
    error = BETWEEN.get(method, CUBIC)
    assert q[:, 0] == approx(np.cos(FREQUENCY * times), abs=error)
    assert qd[:, 0] == approx(-FREQUENCY * np.sin(FREQUENCY * times), abs=2.0 * error)
    one = run.solution(float(times[5]))
    assert (one[0].tolist(), one[1].tolist()) == (q[5].tolist(), qd[5].tolist())
    plain = dyn.simulate(oscillator(), [1.0], [0.0], 2.0, method, **options)
    assert run.q == approx(plain.q, abs=ROUNDING)
    again = pickle.loads(pickle.dumps(run))
    assert (again.solution(times)[0] == q).all()


@mark.parametrize("method", ["rk4", "gauss4"])
def test_a_solution_ends_where_the_run_did(method: str) -> None:
    cut = dyn.Event("cut", lambda q, qd, t: t - 0.3, terminal=True)
    options = step(method, 0.02) | {"backend": "python"}
    for ends in ((1.0, -1.0), (-1.0, 1.0)):
        run = dyn.simulate(
            oscillator(), [1.0], [0.0], t_span=ends, method=method, events=cut, dense_output=True, **options
        )
        assert run.status == 1
        q, _ = run.solution([ends[0], float(run.t[-1])])
        assert q.tolist() == [[1.0], run.q[-1].tolist()]
        for beyond in (ends[0] - 0.1 * ends[1], float(np.nextafter(run.t[-1], ends[1])), np.nan):
            with raises(ValueError, match=r"t must be between -?1 and 0.3 s, where the run was, got"):
                run.solution(beyond)
        with raises(ValueError, match=r"t must be a number or times, \(k,\), got shape \(1, 1\)"):
            run.solution([[0.5]])
    with raises(ValueError, match=r"the run kept its rows alone: .* dense_output=True"):
        dyn.simulate(oscillator(), [1.0], [0.0], 1.0).solution(0.5)


def test_accelerations_and_forces_fulfil_the_equations_of_motion() -> None:
    """Inverse dynamics at the rows gives the applied force; forces are what Lagrange's equation has on the right."""
    system = pulled()
    run = dyn.simulate(system, [0.3, -0.2], [0.0, 1.0], 2.0, tau=[0.5, -0.25], t_eval=np.linspace(0.0, 2.0, 9))
    assert (run.qdd.shape, run.forces.shape) == ((9, 2), (9, 2))
    values = {"t": run.t} | {f"q{i}": run.q[:, i] for i in range(2)} | {f"qd{i}": run.qd[:, i] for i in range(2)}
    inverse = dyn.inverse_dynamics(system)
    values |= {f"qdd{i}": run.qdd[:, i] for i in range(2)}
    tau = inverse.evaluate({name: values[name] for name in inverse.input_names})
    assert tau["tau0"] == approx(np.full(9, 0.5), abs=ROUNDING)
    assert tau["tau1"] == approx(np.full(9, -0.25), abs=ROUNDING)
    x, y = run.q.T
    assert run.forces[:, 0] == approx(run.qdd[:, 0] + x - (y - x), abs=ROUNDING)
    assert run.forces[:, 1] == approx(2.0 * run.qdd[:, 1] + (y - x), abs=ROUNDING)
    again = pickle.loads(pickle.dumps(run))
    assert (again.qdd == run.qdd).all()


def test_parameters_and_mechanisms_have_accelerations_and_forces() -> None:
    run = dyn.simulate(oscillator(), [1.0], [0.0], 1.0, parameters={"m": 0.5}, tau=2.0, t_eval=[0.0, 1.0])
    assert run.qdd == approx((2.0 - 3.0 * run.q) / 0.5, rel=ROUNDING)
    assert run.forces.tolist() == [[2.0], [2.0]]
    arm = random_arm(2)
    run = dyn.simulate(arm, [1.0, 0.2], [0.0] * 2, 0.5, t_eval=[0.0, 0.5], backend="python")
    assert run.qdd.shape == run.forces.shape == (2, 2)
    decay = dyn.simulate(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]), [1.0], None, 1.0)
    assert decay.qdd.shape == decay.forces.shape == (len(decay.t), 0)
