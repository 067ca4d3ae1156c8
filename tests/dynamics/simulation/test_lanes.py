"""Trajectories by chosen steps in lanes: each is to the bit what it is alone, whatever its neighbors do."""

import warnings
from functools import cache
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from dynamics import simulate_many
from dynamics.simulation.ensembles import task
from dynamics.simulation.ensembles.task import FEW_TRAJECTORIES, VECTOR, fits_lanes
from dynamics.simulation.steps.step_program import StepProgram
from tests.dynamics.models import oscillator, random_arm, same
from tests.early_end import stops
from tests.slow import slow

COUNT = FEW_TRAJECTORIES + 5  # more than one vector, and not a whole number of them
TIMES = [0.0, 0.11, 0.12, 0.5, 1.0]
COMPARED = (0, 3, 8, COUNT - 1)
TOP = np.diag([0.1, 0.2, 0.25])  # kg m^2
LANES = ("dop853", "dopri5", "rodas", "taylor")


@cache
def spring() -> dyn.System:
    """A pendulum on a spring, pushed by a force in time, with parameters."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) - p["k"] * (q[0] - 1.0) ** 2 + q[0] * cg.cos(q[1]),
        ["r", "angle"],
        parameters={"k": 5.0},
        forces=lambda q, qd, t: [0.1 * cg.sin(t), 0.0],
    )


@cache
def lone() -> dyn.OdeSystem:
    """A sine, an exponential and a power that have no company: of one point libm computes them."""

    def rates(x: Any, t: Any, p: Any) -> list[Any]:
        return [x[1], -p["g"] * cg.sin(x[0]) + 1e-2 * cg.exp(-x[1]) - 1e-3 * (1.0 + x[2] * x[2]) ** 0.65, x[0]]

    return dyn.OdeSystem(rates, ["x", "y", "z"], {"g": 3.0})


def starts(model: Any, seed: int) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    if isinstance(model, dyn.OdeSystem):
        return rng.normal(size=(COUNT, 3)), None
    n, nq = len(model.velocities), len(model.coordinates)
    return rng.normal(size=(COUNT, nq)) + 1.0 * (nq > n), rng.normal(size=(COUNT, n))


def in_lanes(*arguments: Any, **options: Any) -> dyn.Ensemble:
    """An ensemble, of which no trajectory may be run alone."""
    pytest.importorskip("llvmlite")
    with patch.object(task, "stepper", side_effect=AssertionError("a trajectory is run alone")):
        return simulate_many(*arguments, **options)


def each_is_alone(model: Any, fan: dyn.Ensemble, q: Any, qd: Any, t_end: float, method: str, **options: Any) -> None:
    """To the bit; parameters that differ are inputs of both."""
    varied, t_eval, t0 = options.pop("parameters", {}), options.pop("t_eval"), options.pop("t0", 0.0)
    motion = dyn.prepare(model, method, varied=list(varied), **options)
    for k in range(COUNT):
        given = {name: values[k] for name, values in varied.items()}
        one = motion(q[k], None if qd is None else qd[k], t_end, t0, t_eval=t_eval, parameters=given)
        assert np.array_equal(one.q, fan.q[k])
        assert np.array_equal(one.qd, fan.qd[k])
        for name in ("steps", "rejected", "nfev", "dt", "status", "message"):
            assert getattr(fan.stats, name)[k] == getattr(one.stats, name), name


MODELS: dict[str, Any] = {
    "arm": random_arm(2),
    "oscillator": oscillator(),
    "spring": spring(),
    "lone": lone(),
    "ball": dyn.Mechanism([dyn.Body("top", dyn.Joint("ball"), mass=1.0, center=[0.1, 0.0, -0.3], inertia=TOP)]),
}


@mark.parametrize(
    ("name", "method"),
    [
        ("arm", "dop853"),
        ("spring", "dop853"),
        ("lone", "dop853"),
        ("ball", "dop853"),
        ("spring", "dopri5"),
        ("lone", "rodas"),
        ("spring", "rodas"),
        ("arm", "taylor"),
        *slow(*[(name, method) for name in MODELS for method in LANES]),
    ],
)
def test_each_has_the_bits_that_it_has_alone(name: str, method: str) -> None:
    model = MODELS[name]
    q, qd = starts(model, 1)
    vary = {"spring": "k", "lone": "g", "oscillator": "k"}.get(name)
    parameters = {} if vary is None else {vary: np.linspace(1.0, 30.0, COUNT)}
    fan = in_lanes(model, q, qd, 1.0, method, t_eval=TIMES, parameters=parameters)
    each_is_alone(model, fan, q, qd, 1.0, method, t_eval=TIMES, parameters=parameters)


@mark.parametrize(
    "options",
    [
        {"t_eval": [1.0]},
        {"t_eval": [-1.0], "t_end": -1.0},
        {"t_eval": [0.2, 0.2 + 1e-12, 0.3]},
        {"t_eval": np.linspace(0.0, 1.0, 400)},
        {"t_eval": [0.5], "rtol": 1e-6, "atol": 1e-7, "max_step": 0.05},
        {"t_eval": [0.5, 1.0], "first_step": 1e-3},
        {"t_eval": [0.5, 1.0], "form": "momentum"},
        {"t_eval": [3.5, 4.0], "t0": 3.0, "t_end": 4.0},
    ],
)
def test_options_are_those_of_a_run_alone(options: dict[str, Any]) -> None:
    model = spring()
    q, qd = starts(model, 2)
    options = dict(options)
    t_end = options.pop("t_end", 1.0)
    fan = in_lanes(model, q, qd, t_end, **options)
    each_is_alone(model, fan, q, qd, t_end, "dop853", **options)
    if "form" in options:
        assert fan.p is not None
        one = dyn.simulate(model, q[3], qd[3], t_end, **options)
        assert np.array_equal(fan.p[3], np.asarray(one.p))


def test_lanes_that_are_interrupted_go_on_with_the_same_bits() -> None:
    model = random_arm(2)
    q, qd = starts(model, 4)
    whole = simulate_many(model, q, qd, 2.0, t_eval=[1.0, 2.0])
    with patch.multiple(task, PASSES=3, BLOCK_TIME=0.0):
        assert same(whole, simulate_many(model, q, qd, 2.0, t_eval=[1.0, 2.0]))


def test_a_stiff_one_is_warned_of_as_alone() -> None:
    model = dyn.OdeSystem(lambda x, t, p: [x[1], -p["k"] * x[0] - (p["k"] + 1.0) * x[1]], ["x", "v"], {"k": 1.0})
    k = np.full(COUNT, 2.0)
    k[11] = 2000.0
    with pytest.warns(dyn.SimulationWarning, match="1 of 37 trajectories has a warning: trajectory 11: the system is"):
        fan = simulate_many(model, [1.0, 0.0], None, 2.0, "dopri5", t_eval=[2.0], parameters={"k": k})
    assert [bool(texts) for texts in fan.stats.warnings] == [j == 11 for j in range(COUNT)]
    with pytest.warns(dyn.SimulationWarning, match="the system is stiff"):
        one = dyn.simulate(model, [1.0, 0.0], None, 2.0, "dopri5", t_eval=[2.0], parameters={"k": 2000.0})
    assert np.array_equal(one.q, fan.q[11])


@stops
def test_as_many_steps_as_alone() -> None:
    model = random_arm(2)
    q, qd = starts(model, 6)
    stats = dyn.simulate(model, q[0], qd[0], 1.0).stats
    steps = stats.steps + stats.rejected
    fan = simulate_many(model, q, qd, 1.0, t_eval=[0.01, 1.0], max_steps=steps)
    assert fan.stats.success[0]
    for k in COMPARED:
        with warnings.catch_warnings(action="ignore", category=dyn.SimulationWarning):
            one = dyn.simulate(model, q[k], qd[k], 1.0, t_eval=[0.01, 1.0], max_steps=steps)
        assert (fan.stats.message[k], fan.stats.steps[k]) == (one.stats.message, one.stats.steps)
    assert not fan.stats.success.all()


def test_what_cannot_go_in_lanes_goes_one_by_one() -> None:
    from dynamics import METHODS
    from dynamics.integrators import derive
    from dynamics.simulation.run_options import Steps
    from dynamics.simulation.steps.step_program import step_program

    problem = derive(spring(), {"k": 5.0, "tau0": 0.0, "tau1": 0.0})

    def program(method: str) -> StepProgram:
        return step_program(problem, METHODS[method], dense=False)

    fine = Steps()
    steps = 1000
    assert fits_lanes(program("dop853"), fine, 0, FEW_TRAJECTORIES)
    assert not fits_lanes(program("dop853"), fine, 0, FEW_TRAJECTORIES - 1)
    assert not fits_lanes(program("radau"), Steps("radau"), 0, FEW_TRAJECTORIES)
    assert fits_lanes(program("rk4"), Steps("rk4"), steps, 1)
    assert not fits_lanes(program("rk4"), Steps("rk4", max_steps=999), steps, FEW_TRAJECTORIES)
    assert not fits_lanes(program("gauss4"), Steps("gauss4"), steps, VECTOR - 1)
    assert not fits_lanes(program("dop853"), Steps(rtol=1e-16), 0, FEW_TRAJECTORIES)
    q, qd = starts(spring(), 7)
    one_by_one = simulate_many(spring(), q, qd, 0.3, "radau", t_eval=[0.3])
    each_is_alone(spring(), one_by_one, q, qd, 0.3, "radau", t_eval=[0.3])
    in_python = simulate_many(spring(), q, qd, 0.05, t_eval=[0.05], backend="python")
    each_is_alone(spring(), in_python, q, qd, 0.05, "dop853", t_eval=[0.05], backend="python")
