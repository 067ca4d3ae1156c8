"""Linearization on constraints: against minimal coordinates, published modes, and differences along the constraint."""

import math
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.equations.states.evaluate import evaluate
from tests.dynamics.linkages import four_bar
from tests.slow import slow

DIFFERENCES = 1e-7  # of second order at a step of 1e-4
MODES = 1e-9  # of the fastest mode


def test_a_mass_on_a_rod_is_a_pendulum() -> None:
    """Out of rest, too: the reduced equation of a moving tangent is that of its independent entries."""

    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1]

    rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 4.0}, damping=0.3)
    # x = 2 sin a, a'' = -9.81/2 sin a - 0.3 a': the same in x alone
    alone = dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 * (1.0 + q[0] ** 2 / (4.0 - q[0] ** 2)) + 9.81 * cg.sqrt(4.0 - q[0] ** 2),
        "x",
        forces=lambda q, qd, t: [-0.3 * qd[0] * (1.0 + q[0] ** 2 / (4.0 - q[0] ** 2))],
    )
    angle, rate = 0.4, 1.3
    x, y, vx, vy = 2 * math.sin(angle), -2 * math.cos(angle), 2 * math.cos(angle) * rate, 2 * math.sin(angle) * rate
    reduced = dyn.reduced_linearization(rod, [x, y], [vx, vy])
    expected, by_force = dyn.linearize(alone, [x], [vx])
    assert reduced.states == ("q.x", "qd.x")
    assert pytest.approx(expected, abs=1e-13) == reduced.A
    assert pytest.approx([by_force[1, 0], math.tan(angle) * by_force[1, 0]], abs=1e-14) == reduced.B[1]
    slope, bend = math.tan(angle), rate / math.cos(angle) ** 2  # of y, and of y' at the same x'
    assert reduced.displacements == pytest.approx(np.array([[1, 0], [slope, 0], [0, 1], [bend, slope]]), abs=1e-13)


def test_a_four_bar_is_its_differences_along_the_loop() -> None:
    model = four_bar()
    system, tau, accelerations = model.system, [0.4, 0.0, -0.2], dyn.forward_dynamics(model)
    q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    reduced = dyn.reduced_linearization(model, q, qd, tau)
    assert reduced.A.shape == (2, 2)
    names = [f"{kind}.{name}" for kind in ("q", "qd") for name in system.velocities]
    chosen, x = [names.index(name) for name in reduced.states], np.concatenate([q, qd])

    def rate(state: Array) -> Array:
        qdd = evaluate(system, accelerations, {"q": state[:3], "qd": state[3:], "tau": tau})
        return np.concatenate([state[3:], qdd])

    def along(column: Array) -> tuple[Array, Array]:
        ends = [np.concatenate(nearest_state(model, *np.split(x + s * column, 2))) for s in (-1e-4, 1e-4)]
        return ends[1] - ends[0], rate(ends[1]) - rate(ends[0])

    moved, rates = (np.array(part)[:, chosen].T for part in zip(*map(along, reduced.displacements.T), strict=True))
    expected = rates @ np.linalg.inv(moved)
    assert pytest.approx(expected, abs=DIFFERENCES * np.abs(expected).max()) == reduced.A


@pytest.mark.parametrize("speed", slow(5.0, 0.0))
def test_the_benchmark_bicycle_has_the_published_modes(speed: float) -> None:
    from tests.dynamics.multibody.test_rolling import FRONT, PUBLISHED_MODES, RADII, REAR, bicycle

    qd = np.zeros(9)
    qd[[0, REAR, FRONT]] = speed, -speed / RADII[0], -speed / RADII[1]
    reduced = dyn.reduced_linearization(bicycle(), np.zeros(9), qd)
    assert reduced.A.shape == (10, 10)  # 9 - 2 coordinates, 9 - 6 velocities
    expected = np.array(PUBLISHED_MODES[speed])
    found = np.linalg.eigvals(reduced.A)
    assert np.abs(found[:, None] - expected).min(axis=0).max() < MODES * np.abs(expected).max()
    others = np.delete(found, [int(np.abs(found - mode).argmin()) for mode in expected])
    assert np.abs(others).max() < 1e-5  # of motions that change nothing; zeros of multiplicity split by rounding


def test_a_sleigh_that_runs_straight_turns_back_at_the_known_rate() -> None:
    """w' = -m a v w / (I + m a^2), and nothing else changes a straight run: three positions, two velocities."""
    from tests.dynamics.equations.test_constraints import sleigh

    a, m, inertia, v = 0.4, 1.3, 0.2, 1.7
    reduced = dyn.reduced_linearization(sleigh(), [0.1, 0.2, 0.7], [v * math.cos(0.7), v * math.sin(0.7), 0.0])
    assert len(reduced.states) == 5
    expected = [-m * a * v / (inertia + m * a * a), 0.0, 0.0, 0.0, 0.0]
    assert np.poly(reduced.A) == pytest.approx(np.poly(expected), abs=1e-13)


def test_a_free_body_that_is_pinned_at_a_point_is_a_ball_joint() -> None:
    """Turning, too: displacements of a quaternion are along its angular velocity."""
    numbers: dict[str, Any] = {"mass": 1.3, "inertia": (0.1, 0.2, 0.15)}
    body = dyn.Body("body", dyn.Joint("free"), center=(0.1, 0.0, -0.2), **numbers)
    pinned = dyn.Mechanism([body], loops=[dyn.Loop("point", "body", at=(0, 0, 0.5), to_at=(0, 0, 0.5))])
    joint = dyn.Joint("ball", position=(0.0, 0.0, 0.5))
    ball = dyn.Mechanism([dyn.Body("body", joint, center=(0.1, 0.0, -0.7), **numbers)])
    q, qd = nearest_state(pinned, pinned.system.kinematics.neutral, [0.0, 0.0, 0.0, 0.3, 0.2, 0.1])
    reduced = dyn.reduced_linearization(pinned, q, qd)
    assert reduced.states == tuple([f"{kind}.body.w{axis}" for kind in ("q", "qd") for axis in "xyz"])
    assert pytest.approx(dyn.linearize(ball, [1.0, 0.0, 0.0, 0.0], qd[3:])[0], abs=1e-12) == reduced.A


def test_without_constraints_it_is_linearize() -> None:
    arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.5])
    a, b = dyn.linearize(arm, [0.3, 0.2], [1.0, -0.4], [0.1, 0.2])
    reduced = dyn.reduced_linearization(arm, [0.3, 0.2], [1.0, -0.4], [0.1, 0.2])
    assert np.array_equal(reduced.A, a)
    assert np.array_equal(reduced.B, b)
    assert np.array_equal(reduced.displacements, np.eye(4))


def test_the_modes_have_no_units() -> None:
    found = []
    for model in (four_bar(), four_bar(length=2.0**-30, mass=2.0**40)):
        state = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
        found.append(dyn.reduced_linearization(model, *state).A)
    assert found[1] == pytest.approx(found[0], rel=1e-10)


def test_where_a_constraint_says_nothing_new_there_is_no_linear_form() -> None:
    posts = ((-1.0, 0.0), (1.0, 0.0))
    system = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2 + qd[2] ** 2),
        "x y z",
        constraints=lambda q, t: {
            f"rod {k}": (q[0] - x) ** 2 + (q[1] - y) ** 2 - 1.0 for k, (x, y) in enumerate(posts)
        },
    )
    said = "'rod 1' says nothing that the others do not say"
    with pytest.warns(dyn.ConstraintWarning, match=said), pytest.raises(dyn.ConstraintError, match=said):
        dyn.reduced_linearization(system, [0.0, 0.0, 0.3], [0.0, 0.0, 1.0])
    with pytest.warns(dyn.ConstraintWarning, match="moved onto them"):
        dyn.reduced_linearization(four_bar(), [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
