"""The default absolute tolerance: it has the units of the state, and rounding noise is no state."""

import numpy as np
import pytest
from pytest import mark

import cgraph as cg
import dynamics as dyn
from tests.dynamics.mechanisms import random_body, random_joint, random_rotation
from tests.dynamics.step_options import ADAPTIVE
from tests.dynamics.units import Units, in_units
from tests.slow import slow

AS_WELL = 1e-6  # relative: what another unit may change, runs at rtol 1e-9


def cart_pole(length: float, second: float) -> dyn.System:
    """A pendulum on a cart with a spring, in these units of length and time."""

    def lagrangian(q, qd, t):
        x, v, turning = q[0], second * qd[0], second * qd[1]
        swing = length * turning
        kinetic = 1.0 * v**2 + 0.5 * (v**2 + 2.0 * v * swing * cg.cos(q[1]) + swing**2)
        return (kinetic + 9.81 * length**2 * cg.cos(q[1]) - 1.5 * x**2) / second**2

    return dyn.System(lagrangian, ["x", "angle"])


UNITS = ((2.0**-20, 2.0**30), (1.0, 2.0**-400))
MORE_UNITS = ((2.0**40, 1.0), (2.0**-40, 1.0), (1.0, 2.0**-30))


@mark.parametrize("method", ADAPTIVE)
@mark.parametrize("units", [UNITS, *slow((MORE_UNITS,))])
def test_results_do_not_depend_on_units(method: str, units: tuple[tuple[float, float], ...]) -> None:
    ends, steps = [], []
    for length, second in ((1.0, 1.0), *units):
        start = [0.1 * length, 1.0], [0.0, 0.0]
        run = dyn.simulate(cart_pole(length, second), *start, 3.0 * second, method)
        assert run.success
        assert not run.stats.warnings
        ends.append([*run.q[-1] / [length, 1.0], *run.qd[-1] / [length / second, 1.0 / second]])
        steps.append(run.stats.steps)
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], np.shape(ends)), rtol=AS_WELL)
    assert max(steps) < 1.5 * min(steps)


@mark.parametrize("method", ADAPTIVE)
def test_a_component_of_rounding_alone_does_not_hold_the_steps(method: str) -> None:
    def lagrangian(q, qd, t):  # a spherical pendulum, swinging in the plane turned by 0.3 rad: y is 0 but for rounding
        c, s = np.cos(0.3), np.sin(0.3)
        x, y = c * q[0] - s * q[1], s * q[0] + c * q[1]
        vx, vy = c * qd[0] - s * qd[1], s * qd[0] + c * qd[1]
        height = cg.sqrt(1.0 - x**2 - y**2)
        return 0.5 * (vx**2 + vy**2 + ((x * vx + y * vy) / height) ** 2) + 9.81 * height

    pendulum = dyn.System(lagrangian, ["x", "y"])
    run = dyn.simulate(pendulum, [0.5, 0.0], [0.0, 0.0], 3.0, method, max_steps=5000)
    assert run.success
    assert np.abs(run.q[:, 1]).max() < 1e-9


@mark.parametrize("method", ADAPTIVE)
def test_axes_in_which_bodies_are_drawn_do_not_cost_steps(method: str) -> None:
    """Rods upright, and three closed to a parallelogram: in turned axes they rest but for rounding."""
    rng = np.random.default_rng(0)
    axes = {"world": np.eye(3), **{name: random_rotation(rng) for name in ("left", "top", "right")}}

    def rod(name: str, on: str, place: tuple[float, ...]) -> dyn.Body:
        joint = dyn.Joint("revolute", axes[name].T @ (0, 1, 0), axes[on].T @ place, axes[on].T @ axes[name])
        inertia = axes[name].T @ np.diag([0.1, 0.1, 0.0]) @ axes[name]
        return dyn.Body(name, joint, on, 1.0, axes[name].T @ (0, 0, 0.5), inertia)

    chain = [rod("left", "world", (0, 0, 0)), rod("top", "left", (0, 0, 1))]
    loop = dyn.Loop("point", "top", "right", at=axes["top"].T @ (2, 0, 0), to_at=axes["right"].T @ (0, 0, 1))
    for model in (dyn.Mechanism(chain), dyn.Mechanism([*chain, rod("right", "world", (2, 0, 0))], loops=[loop])):
        start = np.zeros(model.system.n)
        run = dyn.simulate(model, start, start, 0.5, method, rtol=1e-6, max_steps=60)
        assert run.success
        assert 0.0 < np.abs(run.q).max() < 1e-9


@mark.parametrize("length", [2.0**40, 2.0**-40])
def test_lengths_and_angles_of_a_mechanism_take_the_same_steps_in_any_unit(length: float) -> None:
    """Of free bodies, slides and hinges, some of which stand still but for rounding; every bit of the motion."""

    def ends(unit: float, method: str) -> tuple[list[float], int]:
        rng = np.random.default_rng(3)
        base = random_joint("free", rng, stiffness=0.0, damping=0.0, armature=0.0)
        joints = [base, random_joint("revolute", rng), random_joint("prismatic", rng)]
        places = zip(["world", "b0", "b1"], joints, strict=True)
        bodies = [random_body(f"b{i}", "", on, rng, joint=joint) for i, (on, joint) in enumerate(places)]
        model = in_units(dyn.Mechanism(bodies, (0.0, 0.0, -9.81)), Units(length=unit))
        q, qd = rng.uniform(-1e-4, 1e-4, 9), rng.uniform(-1e-3, 1e-3, 8)
        q[3] = 1.0
        sizes = np.array([unit] * 3 + [1.0] * 5 + [unit]), np.array([unit] * 3 + [1.0] * 4 + [unit])
        run = dyn.simulate(model, q * sizes[0], qd * sizes[1], 0.3, method)
        return [*(run.q[-1] / sizes[0]), *(run.qd[-1] / sizes[1])], run.stats.steps + run.stats.rejected

    assert ends(length, "dop853") == ends(1.0, "dop853")


def test_an_angle_that_is_rounding_alone_does_not_hold_the_steps_of_a_slide() -> None:
    """A hinge across the fall, of a body whose center is in line but for rounding."""
    slide = dyn.Body("slide", dyn.Joint("prismatic", (0.0, 0.0, 1.0), stiffness=50.0), mass=1.0)
    hinge = dyn.Joint("revolute", (0.0, 1.0, 0.0), stiffness=1.0)
    rod = dyn.Body("rod", hinge, "slide", 1.0, (1e-17, 0.0, -0.5), (0.1, 0.1, 0.01))
    run = dyn.simulate(dyn.Mechanism([slide, rod]), [0.3, 0.0], [0.0, 0.0], 3.0, max_steps=2000)
    assert run.success
    assert 0.0 < np.abs(run.q[:, 1]).max() < 1e-14


@mark.parametrize("metre", [1.0, *slow(1e-6, 1e6)])
def test_velocities_of_rounding_do_not_hold_a_body_that_rests_in_contact(metre: float) -> None:
    """Its weight and the force of the ground cancel but for rounding; in units of so many metres."""
    stiffness, weight = 1e6 * metre**0.5, 2.0 * 9.81 / metre
    ball = dyn.Body("ball", dyn.Joint("prismatic", (0, 0, 1)), mass=2.0)
    ground = dyn.Contact("ball", radius=0.1 / metre, stiffness=stiffness, dissipation=1.0 * metre)
    resting = dyn.Mechanism([ball], (0.0, 0.0, -9.81 / metre), forces=[ground])
    height = 0.1 / metre - (weight / stiffness) ** (2 / 3)
    for method in ("dop853", "rodas"):
        run = dyn.simulate(resting, [height], [0.0], 1.0, method, max_steps=200)
        assert run.success
        np.testing.assert_allclose(run.q, height, rtol=1e-9)


def test_a_tolerance_that_is_given_stays() -> None:
    decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    loose = dyn.simulate(decay, [1e-3], None, 5.0, atol=1e-3).stats.steps
    assert loose < dyn.simulate(decay, [1e-3], None, 5.0).stats.steps
    assert dyn.simulate(decay, [1e-3], None, 5.0).q[-1, 0] == pytest.approx(1e-3 * np.exp(-5.0), rel=1e-8)
