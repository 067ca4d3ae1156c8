"""Runs in coordinates and momenta: the same motion as in velocities, by every kind of method."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from dynamics.systems.model import as_system

from ..equations.test_hamiltonian import random_tree
from ..linkages import four_bar
from ..models import coupled_springs, driven_pendulum, magnetic, oscillator, random_arm, relativistic

MODELS = {
    "arm": lambda: random_arm(3, damped=False),
    "springs": coupled_springs,
    "relativistic": relativistic,
    "tree": lambda: random_tree(5),
}


def runs(model: Any, t_end: float, method: str, **options: Any) -> list[dyn.Trajectory]:
    system = as_system(model)
    q, qd = np.array(system.kinematics.neutral) + 0.2, np.full(system.n, 0.3)
    options |= {"estimate_error": False} if "dt" in options else {}
    return [dyn.simulate(model, q, qd, t_end, method, form=form, **options) for form in ("velocity", "momentum")]


@pytest.mark.parametrize("name", MODELS)
def test_a_motion_of_10_s_is_the_same_to_a_billionth(name: str) -> None:
    plain, canonical = runs(MODELS[name](), 10.0, "dop853", rtol=1e-13, t_eval=np.linspace(0.0, 10.0, 5))
    for column in ("q", "qd", "energy", "qdd", "forces"):
        expected = getattr(plain, column)
        assert np.abs(getattr(canonical, column) - expected).max() <= 1e-9 * np.abs(expected).max(initial=1.0)
    rows = [dyn.arrays_at(MODELS[name](), dyn.momentum(MODELS[name]()), q, qd, t=t)["p"] for t, q, qd in zip(
        canonical.t, canonical.q, canonical.qd, strict=True)]  # fmt: skip
    assert canonical.p == pytest.approx(np.array(rows), rel=1e-10, abs=1e-10)
    assert plain.p is None
    assert canonical[f"p.{canonical.velocities[0]}"].tolist() == canonical.p[:, 0].tolist()


@pytest.mark.parametrize("method", ["gauss4", "verlet", "symplectic_euler", "yoshida6", "midpoint"])
@pytest.mark.parametrize("make", [magnetic, driven_pendulum, oscillator])
def test_a_symplectic_method_makes_the_same_steps(method: str, make: Any) -> None:
    """It steps q and p in both forms, which differ in how the velocities of p are come by."""
    plain, canonical = runs(make(), 0.5, method, dt=0.05)
    assert canonical.stats.success
    assert canonical.q == pytest.approx(plain.q, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("method", ["radau", "rodas", "rk4"])
def test_other_methods_step_momenta_too(method: str) -> None:
    plain, canonical = runs(random_arm(2), 1.0, method, **({"dt": 1e-3} if method == "rk4" else {"rtol": 1e-10}))
    assert canonical.q[-1] == pytest.approx(plain.q[-1], rel=1e-8, abs=1e-8)


def test_what_the_momentum_form_has_not_is_said() -> None:
    model, event = oscillator(), dyn.Event("middle", lambda q, qd, t: q[0])
    for options, what in (({"events": event}, "without events"), ({"dense_output": True}, "without dense_output")):
        with pytest.raises(ValueError, match=what):
            dyn.simulate(model, [1.0], [0.0], 1.0, form="momentum", **options)
    with pytest.raises(ValueError, match="form"):
        dyn.simulate(model, [1.0], [0.0], 1.0, form="impulse")
    with pytest.raises(ValueError, match="first order"):
        dyn.simulate(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]), [1.0], None, 1.0, form="momentum")
    q, qd = dyn.consistent_state(four_bar(), [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    with pytest.raises(dyn.ConstraintError, match="holds the momenta"):
        dyn.simulate(four_bar(), q, qd, 1.0, form="momentum")


@pytest.mark.parametrize(("light", "speed", "solved"), [(1.0, 0.3, True), (1e-3, 2.0, False)])
def test_velocities_that_the_iteration_does_not_reach_are_no_silent_result(
    light: float, speed: float, solved: bool
) -> None:
    """L = c v^2/2 + v^4/4: from rest Newton's steps leap far where c is small beside v^2."""
    system = dyn.System(lambda q, qd, t: 0.5 * light * qd[0] ** 2 + 0.25 * qd[0] ** 4, ["x"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = dyn.simulate(system, [0.0], [speed], 0.1, form="momentum")
    assert run.stats.warnings == tuple([str(each.message) for each in said])
    if solved:
        assert not run.stats.warnings
        assert run.qd[-1] == pytest.approx([speed], rel=1e-9)
    else:
        assert "velocities do not have the momenta" in run.stats.warnings[0]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("method", ["verlet", "gauss4"])
def test_a_million_steps_leave_the_energy_in_its_band(method: str) -> None:
    """No drift: of the band over the first tenth of the run, the last tenth keeps within a hundredth."""
    arm, dt = random_arm(2, damped=False), 2.0**-7
    times = dt * np.arange(0, 1_000_001, 10)
    how = {"dt": dt, "t_eval": times, "form": "momentum", "estimate_error": False}
    run = dyn.simulate(arm, [1.0, -0.5], [0.0, 0.0], times[-1], method, **how)
    assert run.stats.steps == 1_000_000
    error = run.energy - run.energy[0]
    first, last = error[:10_000], error[-10_000:]
    band = np.ptp(first)
    assert abs(last.mean() - first.mean()) <= 0.01 * band
    assert np.ptp(last) <= 1.1 * band
