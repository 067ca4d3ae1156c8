"""Runs in coordinates and momenta: all that a run in velocities has, and the same numbers."""

from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import as_system
from dynamics.equations.states.consistent_state import nearest_state

from ...slow import slow
from ..equations.test_hamiltonian import random_tree, rotor
from ..linkages import four_bar
from ..models import coupled_springs, driven_pendulum, magnetic, oscillator, random_arm, relativistic
from .test_motion_gradients import BEAD, loss

FORMS = ("velocity", "momentum")
MODELS = {
    "springs": coupled_springs,
    "relativistic": relativistic,
    "tree": lambda: random_tree(5),
}
SCENES = {name: (lambda name=name: dyn.scenes.load(name)) for name in dyn.scenes.names()}
SAME = 1e-9  # of the largest entry: runs whose steps keep 1e-12
KINDS = {"driven": driven_pendulum, "magnetic": magnetic, "rotor": rotor}


def start(model: Any) -> tuple[Any, Any]:
    """That of a scene; else one that is nowhere special."""
    if isinstance(model, dyn.scenes.Scene):
        return model.q, model.qd
    system = as_system(model)
    return np.array(system.kinematics.neutral) + 0.2, np.full(system.n, 0.3)


def runs(model: Any, t_end: float, method: str, **options: Any) -> list[dyn.Trajectory]:
    q, qd = start(model)
    options |= {"estimate_error": False} if "dt" in options else {}
    return [dyn.simulate(model, q, qd, t_end, method, form=form, **options) for form in FORMS]


def assert_same(here: Any, there: Any, bound: float = SAME) -> None:
    here, there = np.asarray(here), np.asarray(there)
    assert here.shape == there.shape
    assert np.abs(here - there).max(initial=0.0) <= bound * np.abs(there).max(initial=1.0)


@pytest.mark.parametrize("name", ["tree", *slow("springs", "relativistic", *SCENES)])
def test_a_motion_of_10_s_is_the_same_to_a_billionth(name: str) -> None:
    """The scenes without constraints, and models with what they have not; none of them forgets its start in 10 s."""
    model = (MODELS | SCENES)[name]()
    plain, canonical = runs(model, 10.0, "dop853", rtol=1e-13, t_eval=np.linspace(0.0, 10.0, 5))
    for column in ("q", "qd", "energy", "qdd", "forces"):
        assert_same(getattr(canonical, column), getattr(plain, column))
    rows = [dyn.arrays_at(model, dyn.momentum(model), q, qd, t=t)["p"] for t, q, qd in zip(
        canonical.t, canonical.q, canonical.qd, strict=True)]  # fmt: skip
    assert canonical.p == pytest.approx(np.array(rows), rel=1e-10, abs=1e-10)
    assert plain.p is None
    assert canonical[f"p.{canonical.velocities[0]}"].tolist() == canonical.p[:, 0].tolist()


STEPS = [("gauss4", magnetic), ("verlet", driven_pendulum)]
MORE = [("symplectic_euler", magnetic), ("yoshida6", driven_pendulum), ("midpoint", oscillator)]


@pytest.mark.parametrize(("method", "make"), [*STEPS, *slow(*MORE)])
def test_a_symplectic_method_makes_the_same_steps(method: str, make: Any) -> None:
    """It steps q and p in both forms, which differ in how the velocities of p are come by."""
    plain, canonical = runs(make(), 0.5, method, dt=0.05)
    assert canonical.stats.success
    assert canonical.q == pytest.approx(plain.q, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("method", ["gauss4", *slow("midpoint", "yoshida6")])
def test_methods_of_gauss_step_more_coordinates_than_momenta(method: str) -> None:
    """As those of a quaternion, whose length and whose energy they keep."""
    body = dyn.Body("top", dyn.Joint("ball"), mass=1.3, center=(0.1, 0.2, 0.3), inertia=(0.3, 0.4, 0.5))
    top, dt = dyn.Mechanism([body], gravity=(0.0, 0.0, -9.81)), {"midpoint": 2.0**-11}.get(method, 2.0**-6)
    how: dict[str, Any] = {"t_end": 0.5, "method": method, "dt": dt, "estimate_error": False, "form": "momentum"}
    run = dyn.simulate(top, [1.0, 0.0, 0.0, 0.0], [0.3, 0.6, 0.9], **how)
    exact = dyn.simulate(top, [1.0, 0.0, 0.0, 0.0], [0.3, 0.6, 0.9], t_end=0.5, rtol=1e-12)
    assert_same(run.q[-1], exact.q[-1], 1e-6)
    assert_same(np.linalg.norm(run.q, axis=1), np.ones(len(run.t)), 1e-12)
    assert np.ptp(run.energy) < 1e-6 * np.abs(run.energy).max()


def watched(n: int) -> list[dyn.Event]:
    """Quantities of q, qd and t; one of them brakes all velocities, and turns the first."""

    def braked(q: Any, qd: Any, t: Any) -> Any:
        return q, [-0.5 * qd[0], *[0.9 * rate for rate in qd[1:]]]

    return [
        dyn.Event("early", lambda q, qd, t: t - 0.3 + 0.2 * qd[n - 1]),
        dyn.Event("brake", lambda q, qd, t: t - 0.5 + 0.1 * qd[0] * q[0], direction=1, reset=braked),
        dyn.Event("late", lambda q, qd, t: t - 0.9 + 0.1 * qd[0], terminal=True),
    ]


@pytest.mark.parametrize("name", ["rotor", *slow("driven", "magnetic", "relativistic")])
def test_events_resets_and_dense_output_are_of_the_same_velocities(name: str) -> None:
    """Also where L depends on t, momenta have an offset, L is not quadratic, and coordinates are a quaternion."""
    model = (KINDS | MODELS)[name]()
    how = {
        "rtol": 1e-12,
        "atol": 1e-12,
        "events": watched(as_system(model).n),
        "dense_output": True,
        "backend": "python",
    }
    plain, canonical = runs(model, 1.0, "dop853", **how)
    assert canonical.stats.message.split(" at ")[0] == plain.stats.message.split(" at ")[0] == "event 'late'"
    for event, crossings in plain.events.items():
        for column in crossings._fields:
            assert_same(getattr(canonical.events[event], column), getattr(crossings, column))
    assert all(len(crossings.t) for crossings in plain.events.values())
    inside = np.linspace(0.0, min(plain.t[-1], canonical.t[-1]), 7)
    for here, there in zip(canonical.solution(inside), plain.solution(inside), strict=True):
        assert_same(here, there)
    assert [array.shape for array in canonical.solution(0.5)] == [array.shape for array in plain.solution(0.5)]


@pytest.mark.parametrize("method", ["dop853", *slow("rk4")])
def test_a_sampled_controller_sees_velocities(method: str) -> None:
    """Of a model whose momenta are not M qd alone: the same forces at the same times, with events besides."""

    def control(q: Any, qd: Any, t: float) -> Any:
        return 3.0 * (0.5 - q) - 2.0 * qd

    how = {"rtol": 1e-12, "backend": "python"} if method == "dop853" else {"dt": 1e-3}
    how |= {"tau": dyn.SampledController(control, 0.1), "events": watched(2)[:2], "t_eval": [0.0, 0.35, 0.8]}
    plain, canonical = runs(magnetic(), 0.8, method, **how)
    for column in ("q", "qd", "tau", "energy"):
        assert_same(getattr(canonical, column), getattr(plain, column))
    assert_same(canonical.held.tau, plain.held.tau)
    assert_same(canonical.events["brake"].t, plain.events["brake"].t)


def test_gradients_of_a_motion_are_the_same() -> None:
    """By the start, where p depends on q, and by a parameter that the first momentum depends on; through events."""
    start, how = ([0.5], [0.2]), {"t_end": 1.0, "method": "dop853", "rtol": 1e-12, "backend": "python"}
    how |= {"events": watched(1)[1:], "wrt": ["q", "qd", "m"]}
    velocity, momentum = (dyn.gradient(BEAD, loss, *start, form=form, **how) for form in FORMS)
    assert_same([momentum.value, *momentum.q, *momentum.qd], [velocity.value, *velocity.q, *velocity.qd])
    forward = [dyn.sensitivities(BEAD, *start, form=form, **how) for form in FORMS]
    for name in how["wrt"]:
        assert_same(momentum[name], velocity[name])
        assert_same(forward[1][name][-1], forward[0][name][-1])
        assert_same(forward[1].times[name][-1], forward[0].times[name][-1])
    assert_same(forward[1].qd[-1], forward[0].qd[-1])


def test_what_the_momentum_form_has_not_is_said() -> None:
    with pytest.raises(ValueError, match="form"):
        dyn.simulate(oscillator(), [1.0], [0.0], 1.0, form="impulse")
    first_order = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    for run in (dyn.simulate, dyn.simulate_many):
        with pytest.raises(ValueError, match="first order"):
            run(first_order, [[1.0]] if run is dyn.simulate_many else [1.0], None, 1.0, t_eval=[1.0], form="momentum")
    q, qd = nearest_state(four_bar(), [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    with pytest.raises(dyn.ConstraintError, match="holds the momenta"):
        dyn.simulate(four_bar(), q, qd, 1.0, form="momentum")


BOUNDED = dyn.System(lambda q, qd, t: cg.sqrt(1.0 + qd[0] ** 2) + q[0], "x")  # momenta up to 1, and a force goes on
FOLDED = dyn.System(lambda q, qd, t: 0.25 * qd[0] ** 4 - 0.5 * qd[0] ** 2, "x")  # some momenta have three velocities
MISSED = [(BOUNDED, 1.5, "velocities do not have the momenta"), (FOLDED, 0.1, "0.1.* in place of 0.9")]


@pytest.mark.parametrize(("model", "t_end", "said"), MISSED, ids=["bounded", "folded"])
def test_velocities_that_momenta_do_not_have_are_no_silent_result(model: Any, t_end: float, said: str) -> None:
    how: dict[str, Any] = {"t_end": t_end, "form": "momentum", "method": "euler", "dt": 0.1, "estimate_error": False}
    how |= {"backend": "python"}
    with pytest.warns(dyn.SimulationWarning, match=said) as record:
        run = dyn.simulate(model, [0.0], [0.9], **how)
    assert run.stats.warnings == tuple([str(each.message) for each in record])
    with pytest.warns(dyn.SimulationWarning, match=f"1 of 2 trajectories has a warning: trajectory 1: .*{said}"):
        fan = dyn.simulate_many(model, [0.0], [[-2.0 if model is BOUNDED else 0.0], [0.9]], **how)
    assert [len(texts) for texts in fan.stats.warnings] == [0, len(run.stats.warnings)]


@pytest.mark.parametrize("derive", [dyn.gradient_many, *slow(dyn.gradient, dyn.sensitivities)])
def test_nor_are_their_derivatives(derive: Any) -> None:
    where = [] if derive is dyn.sensitivities else [lambda q, qd, t: q[0]]
    qd, number = ([[0.0], [0.9]], "1 of 2 motions doubtful: motion 1: ") if derive is dyn.gradient_many else ([0.9], "")
    given = {"form": "momentum", "wrt": "q", "backend": "python", "estimate_error": False}
    with pytest.warns(dyn.SimulationWarning, match=f"{number}the momenta of the start .*0.1.* in place of 0.9"):
        derive(FOLDED, *where, [0.0], qd, 0.1, "euler", dt=0.1, **given)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["verlet", "gauss4"])
def test_a_million_steps_leave_the_energy_in_its_band(method: str) -> None:
    """No drift: of the band over the first tenth of the run, the last tenth keeps within a hundredth."""
    arm, dt = random_arm(2, damped=False), 2.0**-7
    how = {"dt": dt, "form": "momentum", "estimate_error": False}
    run = dyn.simulate(arm, [1.0, -0.5], [0.0, 0.0], 1_000_000 * dt, method, **how)
    assert run.stats.steps == 1_000_000
    error = run.energy - run.energy[0]
    first, last = error[:100_000], error[-100_000:]
    band = np.ptp(first)
    assert abs(last.mean() - first.mean()) <= 0.01 * band
    assert np.ptp(last) <= 1.01 * band
