"""Constraints of any Lagrangian: what they hold, what they say nothing about, and what is refused."""

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn


def plane(q: Any, qd: Any, t: Any) -> Any:
    """A particle of 1 kg and a turning inertia, in x, y and an angle."""
    return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + 0.3 * qd[2] ** 2) - 9.81 * q[1]


@cache
def sleigh(a: float = 0.4, m: float = 1.3, inertia: float = 0.2) -> dyn.System:
    """Chaplygin's: a blade at (x, y), the center of mass a ahead of it."""

    def energy(q: Any, qd: Any, t: Any) -> Any:
        vx, vy = qd[0] - a * cg.sin(q[2]) * qd[2], qd[1] + a * cg.cos(q[2]) * qd[2]
        return 0.5 * m * (vx * vx + vy * vy) + 0.5 * inertia * qd[2] ** 2

    def blade(q: Any, qd: Any, t: Any) -> Any:
        return {"blade": cg.cos(q[2]) * qd[1] - cg.sin(q[2]) * qd[0]}

    return dyn.System(energy, "x y angle", velocity_constraints=blade)


def test_chaplygins_sleigh_has_its_known_accelerations() -> None:
    """v' = a w^2, w' = -m a v w / (I + m a^2): not those of the action made stationary under the constraint."""
    a, m, inertia, angle, v, w = 0.4, 1.3, 0.2, 0.7, 1.1, 0.9
    at = {"q0": 0.1, "q1": 0.2, "q2": angle, "qd0": v * math.cos(angle), "qd1": v * math.sin(angle), "qd2": w}
    found = dyn.forward_dynamics(sleigh()).evaluate(at | {f"tau{i}": 0.0 for i in range(3)})
    along = found["qdd0"] * math.cos(angle) + found["qdd1"] * math.sin(angle)
    assert along == pytest.approx(a * w * w, rel=1e-14)
    assert found["qdd2"] == pytest.approx(-m * a * v * w / (inertia + m * a * a), rel=1e-14)


@cache
def moving_wall() -> dyn.System:
    """x = sin(w t)."""
    return dyn.System(plane, "x y a", {"w": 3.0}, constraints=lambda q, t, p: {"wall": q[0] - cg.sin(p["w"] * t)})


def test_a_moving_wall_drives() -> None:
    """Acceleration, force, and a start on the wall's velocity."""
    driven = moving_wall()
    at = {f"{kind}{i}": 0.0 for kind in ("q", "qd", "tau") for i in range(3)} | {"t": 0.3, "w": 3.0}
    found = dyn.forward_dynamics(driven).evaluate(at)
    assert found["qdd0"] == pytest.approx(-9.0 * math.sin(0.9), rel=1e-14)
    assert found["lambda0"] == pytest.approx(-9.0 * math.sin(0.9), rel=1e-14)
    with pytest.warns(dyn.ConstraintWarning, match=r"velocity 'x' by 3"):
        run = dyn.simulate(driven, [0.0] * 3, [0.0] * 3, 1.0, t_eval=[0.5, 1.0])
    assert run.q[:, 0] == pytest.approx(np.sin(3.0 * run.t), abs=1e-14)
    assert run.qd[:, 0] == pytest.approx(3.0 * np.cos(3.0 * run.t), abs=1e-14)


def test_an_ensemble_keeps_its_constraints() -> None:
    rod = dyn.System(
        plane, "x y a", {"l": 1.0}, constraints=lambda q, t, p: {"rod": q[0] ** 2 + q[1] ** 2 - p["l"] ** 2}
    )
    lengths = np.array([0.5, 1.0, 2.0])
    starts = np.array([[length, 0.0, 0.0] for length in lengths])
    many = dyn.simulate_many(rod, starts, np.zeros((3, 3)), 2.0, parameters={"l": lengths}, method="rk4", dt=1e-3)
    assert np.hypot(many.q[:, -1, 0], many.q[:, -1, 1]) == pytest.approx(lengths, rel=1e-14)


def test_constraints_may_have_a_domain() -> None:
    """Some of the states at which rows are compared are outside of it."""
    ring = dyn.System(plane, "x y a", constraints=lambda q, t: {"ring": cg.sqrt(q[0]) + cg.log(q[1]) - 1.0})
    q, _ = dyn.consistent_state(ring, [1.5, 1.2, 0.0], [0.0] * 3)
    assert math.sqrt(q[0]) + math.log(q[1]) == pytest.approx(1.0, abs=1e-15)
    nowhere = dyn.System(plane, "x y a", constraints=lambda q, t: {"bad": cg.sqrt(-1.0 - q[0] ** 2)})
    with pytest.raises(dyn.ConstraintError, match="no state was seen where 'bad' is 0"):
        dyn.forward_dynamics(nowhere)


def test_info_names_the_constraint_that_says_nothing_new_at_a_state() -> None:
    """Two rods to one particle in a plane hold it, unless they are in line."""
    posts = ((-1.0, 0.0), (1.0, 0.0))

    def rods(q: Any, t: Any) -> Any:
        return {f"rod {k}": (q[0] - x) ** 2 + (q[1] - y) ** 2 - 2.0 for k, (x, y) in enumerate(posts)}

    held = dyn.System(plane, "x y a", constraints=rods)
    graph = dyn.forward_dynamics(held, check=True)
    at = {f"{kind}{i}": 0.0 for kind in ("q", "qd", "tau") for i in range(3)}
    assert graph.evaluate(at | {"q1": 1.0})["info"] == 0.0
    info = graph.evaluate(at)["info"]
    with pytest.raises(dyn.SingularMassMatrixError, match="the constraints are singular: constraint 'rod 0' follows"):
        dyn.raise_if_singular(held, info)


@cache
def pulleys() -> dyn.System:
    """A rope over two pulleys: the hook y between masses has no inertia, and 2 y = x - z."""

    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * (2.0 * qd[0] ** 2 + 3.0 * qd[2] ** 2) - 9.81 * (2.0 * q[0] + 3.0 * q[2])

    return dyn.System(energy, "x hook z", constraints=lambda q, t: {"rope": 2.0 * q[1] - q[0] + q[2]})


def test_a_coordinate_without_inertia_may_be_held_by_a_constraint() -> None:
    rope = pulleys()
    at = {f"{kind}{i}": 0.0 for kind in ("q", "qd", "tau") for i in range(3)}
    found = dyn.forward_dynamics(rope).evaluate(at | {"tau1": 4.0})
    assert [found[name] for name in ("qdd0", "qdd2", "lambda0")] == pytest.approx([-8.81, -9.81 - 2.0 / 3.0, -2.0])
    assert found["qdd1"] == pytest.approx(0.5 * (found["qdd0"] - found["qdd2"]))
    hidden = dyn.System(
        lambda q, qd, t: (
            (0.1 * qd[0] + 0.3 * qd[1]) ** 2 + cg.exp(q[2]) * (0.7 * qd[0] + 2.1 * qd[1]) ** 2 + qd[2] ** 2
        ),
        "x y z",
        constraints=lambda q, t: {"row": q[0] - q[2]},
    )
    with pytest.raises(dyn.SingularMassMatrixError, match="a motion of 'x' and 'y' has no inertia"):
        dyn.forward_dynamics(hidden)


def test_what_constraints_cannot_be_is_said() -> None:
    cases: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"constraints": 3.0}, TypeError, r"constraints must be a function of \(q, t\) or \(q, t, p\)"),
        ({"constraints": lambda q, t: [q[0] + "x"]}, TypeError, "."),
        ({"constraints": lambda q, t: cg.variable("qd0")}, ValueError, "coordinates, t and parameters alone"),
        ({"constraints": lambda q, t: cg.variable("k")}, ValueError, "'k', which is no coordinate"),
        ({"velocity_constraints": lambda q, u, t: [u[0] ** 2]}, ValueError, "must be linear in the velocities"),
        ({"constraints": lambda q, t: {"": q[0]}}, ValueError, "."),
    ]
    for given, kind, message in cases:
        with pytest.raises(kind, match=message):
            dyn.System(plane, "x y a", **given)
    twice = {"constraints": lambda q, t: {"r": q[0]}, "velocity_constraints": lambda q, u, t: {"r": u[1]}}
    with pytest.raises(ValueError, match="two constraints have the name 'r'"):
        dyn.System(plane, "x y a", **twice)


def test_symplectic_methods_step_the_state_of_what_is_held_or_say_that_they_cannot() -> None:
    rod = dyn.System(plane, "x y a", constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0})
    start = dyn.consistent_state(rod, [1.0, 0.0, 0.0], [0.0, 1.0, 1.0])
    run = dyn.simulate(rod, *start, 20.0, "gauss4", dt=0.02)
    assert np.abs(np.hypot(run.q[:, 0], run.q[:, 1]) - 1.0).max() < 1e-15
    early, late = run.energy[:500], run.energy[500:]
    assert np.ptp(late) < 1.2 * np.ptp(early) < 1e-4  # no drift
    for method in ("verlet", "symplectic_euler"):
        with pytest.raises(
            ValueError, match=r"in turn, which .* with constraints .* take 'midpoint', 'gauss4' or 'dop853'"
        ):
            dyn.simulate(sleigh(), [0.0] * 3, [0.0] * 3, 0.1, method)


@pytest.mark.parametrize("unit", [1.0, 2.0**-9, 2.0**9])
def test_velocities_that_are_moved_by_rounding_alone_are_no_warning(unit: float) -> None:
    """A rod that turns: a second time its velocity is moved by its last bits, in any units; one of its own is said."""
    rod = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2),
        "x y",
        constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - unit**2},
    )
    with pytest.warns(dyn.ConstraintWarning, match="velocities do not meet the constraints"):
        q, qd = dyn.consistent_state(rod, [3.0 * unit, 4.0 * unit], [unit, 0.0])
    again = dyn.consistent_state(rod, q, qd)  # no warning
    assert np.abs(again[1] - qd).max() <= 1e-14 * unit
    dyn.consistent_state(rod, q, [0.0, 0.0])
    with pytest.warns(dyn.ConstraintWarning, match="velocities do not meet the constraints"):
        dyn.consistent_state(rod, q, qd * [1.0, 1.0 + 1e-6])


@pytest.mark.parametrize(
    ("what", "row", "words"),
    [
        (
            "velocity_constraints",
            lambda q, qd, t: q[0] ** 2 + q[1] ** 2 - 1.0,
            "in it; a condition on positions",
        ),
        ("velocity_constraints", lambda q, qd, t: cg.sin(t), "has no velocity in it"),
        ("velocity_constraints", lambda q, qd, t: 0.0 * qd[0], "has no velocity in it"),
        ("constraints", lambda q, t: cg.sin(t), "is the same at all coordinates"),
        ("constraints", lambda q, t: cg.cos(q[0]) ** 2 + cg.sin(q[0]) ** 2 - 1.0, "is the same at all coordinates"),
        ("constraints", lambda q, t: (q[0] ** 2 + q[1] ** 2 - 1.0) ** 2, "wherever it is met its slopes are 0"),
        ("constraints", lambda q, t: 1.0 - cg.cos(q[0]), "wherever it is met its slopes are 0"),
    ],
)
def test_a_condition_that_would_hold_nothing_is_refused(what: str, row: Any, words: str) -> None:
    """Squares of what holds a pendulum have no slope on it; the root of each holds it."""
    named = (lambda q, t: {"rod": row(q, t)}) if what == "constraints" else (lambda q, qd, t: {"rod": row(q, qd, t)})
    with pytest.raises(ValueError, match=f"constraint 'rod' .*{words}"):
        dyn.forward_dynamics(dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2, "x y", **{what: named}))
