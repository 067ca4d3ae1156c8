"""Hand-over: bodies caught and let go, with momentum and energy accounted for."""

from typing import Any

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from tests.dynamics.mechanisms import Array, random_body, random_inertia
from tests.tolerances import EQUATIONS, LONG_SUM, SHORT_SUM, SOLVED, SUMS


def arm(n: int = 3, seed: int = 0, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> dyn.Mechanism:
    """n hinges about any axes, with springs, damping and armature; the first is about z."""
    rng = np.random.default_rng(seed)
    bodies = [random_body(f"b{i}", "revolute", f"b{i - 1}" if i else "world", rng) for i in range(n)]
    first = bodies[0]
    bodies[0] = dyn.Body("b0", dyn.Joint("revolute"), mass=first.mass, center=first.center, inertia=first.inertia)
    return dyn.Mechanism(bodies, gravity)


def load(seed: int = 5) -> dyn.Body:
    """A body to be gripped, some way off the hand."""
    rng = np.random.default_rng(seed)
    grip = dyn.Joint("fixed", position=0.2 * rng.normal(size=3))
    return dyn.Body("load", grip, "b2", 0.7, 0.1 * rng.normal(size=3), random_inertia(rng))


def placed(mechanism: dyn.Mechanism, body: str, at: Any, q: Array) -> dict[str, Array]:
    """Where a point is, the body's axes, and the Jacobian of both."""
    frame = mechanism, body, at
    return dyn.arrays_at(mechanism, dyn.frame_placement(*frame), q) | dyn.arrays_at(
        mechanism, dyn.frame_jacobian(*frame), q
    )


def mass(mechanism: dyn.Mechanism, q: Array) -> Array:
    return dyn.arrays_at(mechanism, dyn.mass_matrix(mechanism), q)["M"]


def kinetic(mechanism: dyn.Mechanism, q: Array, qd: Array) -> float:
    return float(qd @ mass(mechanism, q) @ qd) / 2.0


@mark.parametrize("seed", range(4))
def test_the_energy_lost_is_that_of_an_inelastic_impact(seed: int) -> None:
    """D . (J M^-1 J^T + diag(m 1, I)^-1)^-1 D / 2 for the difference D of the two velocities at the grip."""
    holder, body = arm(seed=seed), load(seed)
    rng = np.random.default_rng(seed)
    q, qd, v, w = rng.normal(size=(4, 3))
    found = dyn.attach_with_impact(holder, q, qd, body, velocity=v, omega=w)
    place = np.asarray(body.joint.position) + np.asarray(body.center)
    m = mass(holder, q)
    where = placed(holder, "b2", place, q)
    j, r = where["J"], where["R"]
    own = np.block([[body.mass * np.eye(3), np.zeros((3, 3))],
                    [np.zeros((3, 3)), r @ np.asarray(body.inertia) @ r.T]])  # fmt: skip
    difference = j @ qd - np.concatenate([v, w])
    resists = np.linalg.inv(j @ np.linalg.solve(m, j.T) + np.linalg.inv(own))
    assert found.energy == approx(difference @ resists @ difference / 2.0, rel=SOLVED)
    assert found.qd == approx(qd - np.linalg.solve(m, j.T @ resists @ difference), rel=SOLVED, abs=SOLVED)
    free = (body.mass * v @ v + w @ own[3:, 3:] @ w) / 2.0
    assert kinetic(holder, q, qd) + free - kinetic(found.mechanism, q, found.qd) == approx(found.energy, rel=SUMS)


def test_a_body_that_is_let_go_leaves_with_the_velocity_of_the_hand() -> None:
    holder = arm().attach(load())
    q, qd = np.random.default_rng(1).normal(size=(2, 3))
    found = dyn.release(holder, q, qd, "load")
    assert (found.q.tolist(), found.qd.tolist()) == (q.tolist(), qd.tolist())
    assert [body.name for body in found.mechanism.bodies] == ["b0", "b1", "b2"]
    where = placed(holder, "load", load().center, q)
    assert np.concatenate([found.body.velocity, found.body.omega]) == approx(where["J"] @ qd, abs=LONG_SUM)
    assert found.body.position == approx(where["p"], abs=SHORT_SUM)
    assert found.body.orientation == approx(where["R"], abs=SHORT_SUM)
    again = dyn.attach_with_impact(found.mechanism, q, qd, load(), velocity=found.body.velocity, omega=found.body.omega)
    assert (again.qd, again.energy) == (approx(qd, rel=EQUATIONS), approx(0.0, abs=EQUATIONS))


def test_a_body_can_be_caught_on_a_hinge_and_by_a_locked_arm() -> None:
    """A hook: the load's own turn about the hook's axis is not changed where no lever reaches it."""
    holder = arm(gravity=(0.0, 0.0, 0.0))
    hook = dyn.Body("load", dyn.Joint("revolute", (0.0, 0.0, 1.0), (0.1, 0.0, 0.0)), "b2", 0.7, inertia=(0.1, 0.1, 0.2))
    q, qd = np.random.default_rng(2).normal(size=(2, 3))
    found = dyn.attach_with_impact(holder, q, qd, hook)
    assert (found.q.shape, found.q[3]) == ((4,), 0.0)
    moves = dyn.arrays_at(found.mechanism, found.mechanism.motion("load"), found.q, found.qd)
    assert moves["R"][:, 2] @ [moves[f"w{axis}"] for axis in "xyz"] == approx(0.0, abs=LONG_SUM)
    held = dyn.attach_with_impact(holder.lock("b2", 0.3), q[:2], qd[:2], load())
    assert held.qd.shape == (2,)
    assert held.energy > 0.0


def test_wrong_hand_overs_are_refused() -> None:
    holder = arm()
    with raises(dyn.MechanismError, match="body 'b0' carries 'b1'"):
        dyn.release(holder, [0.0] * 3, [0.0] * 3, "b0")
    with raises(dyn.MechanismError, match="there is no body 'nobody'"):
        dyn.release(holder, [0.0] * 3, [0.0] * 3, "nobody")
    with raises(ValueError, match=r"q must have shape \(3,\)"):
        dyn.attach_with_impact(holder, [0.0], [0.0] * 3, load())
    with raises(dyn.MechanismError, match="velocity must be"):
        dyn.attach_with_impact(holder, [0.0] * 3, [0.0] * 3, load(), velocity=(1.0, 2.0))


def test_a_scene_stands_for_its_mechanism() -> None:
    scene = dyn.scenes.load("triple_pendulum")
    shorter = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    assert [len(part) for part in shorter.map_state_from(scene, scene.q, scene.qd)] == [2, 2]
    assert dyn.Rows(scene).inverse(scene.q, scene.qd, [0.0] * 3).shape == (3,)
    with raises(dyn.MechanismError, match="release takes rigid bodies, a Mechanism or a scene of one, got Scene"):
        dyn.release(dyn.scenes.load("spring_mass"), [0.0], [0.0], "a")
