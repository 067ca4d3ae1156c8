"""Ball and free joints: every graph against MuJoCo, against the other formulations, and against joints of one axis."""

import math

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from dynamics import System
from tests.dynamics import mechanisms
from tests.dynamics.mechanisms import for_peers
from tests.dynamics.models import Array, run as values

ROUNDING = 1e-12  # of the largest of its kind, in some hundred sums


def random_tree(seed: int, base: str = "free", most: int = 5) -> dyn.Mechanism:
    """A tree of ball joints, hinges, slides and welds on a base of that kind, with springs, damping and armature."""
    return for_peers(mechanisms.random_tree(seed, most - seed % most, base=base), seed)


def state(system: System, seed: int, **more: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    sizes = {"q": system.nq, "qd": system.n} | dict.fromkeys(more, system.n)
    return {f"{name}{i}": float(x) for name, size in sizes.items() for i, x in enumerate(rng.normal(size=size))}


def near(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= ROUNDING * np.abs(b).max())


@mark.parametrize("angle", [0.0, 1e-300, 1e-150, 1e-8, 0.3, 2.0, 3.0, math.pi - 1e-9, math.pi + 1e-9, 6.0])
def test_a_ball_s_spring_pulls_back_by_the_shortest_way(angle: float) -> None:
    """k times the rotation vector, with slopes where nothing is stretched, too; at any length of the quaternion."""
    k, axis = 3.0, np.array([2.0, -1.0, 2.0]) / 3.0
    ball = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball", stiffness=k), inertia=(1.0, 2.0, 3.0))], gravity=(0, 0, 0))
    e = 7.0 * np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
    shortest = angle if angle <= math.pi else angle - 2.0 * math.pi
    at = {f"q{i}": float(x) for i, x in enumerate(e)} | dict.fromkeys(("qd0", "qd1", "qd2"), 0.0)
    pull = values(dyn.bias(ball), at)
    assert pull == approx(k * shortest * axis, rel=2e-15, abs=0.0)
    energy = dyn.energy(ball).evaluate(at)
    assert sum(energy.values()) == approx(0.5 * k * shortest**2, rel=4e-15, abs=0.0)
    A, _ = dyn.linearize(ball, e, np.zeros(3))
    c = shortest / 2.0 / math.tan(shortest / 2.0) if shortest else 1.0
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    slopes = c * np.eye(3) + (1.0 - c) * np.outer(axis, axis) + 0.5 * shortest * cross  # of the rotation vector
    assert A[3:, :3] == approx(-k * slopes / np.array([[1.0], [2.0], [3.0]]), rel=0, abs=1e-14)


def test_the_length_of_a_quaternion_has_no_part_in_anything() -> None:
    mechanism = random_tree(3)
    at = state(mechanism.system, 2, qdd=1, tau=1)
    longer = at | {f"q{i}": 3.0 * at[f"q{i}"] for i, name in enumerate(mechanism.coordinates) if ".q" in name}
    assert longer != at
    for graph in (dyn.inverse_dynamics(mechanism), dyn.forward_dynamics(mechanism), dyn.energy(mechanism)):
        assert near(values(graph, longer), values(graph, at))


def test_what_joints_of_several_freedoms_cannot_have_is_said() -> None:
    turning = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=1.0, inertia=(1.0, 1.0, 1.0)),
                             dyn.Body("c", dyn.Joint("revolute"), "b", inertia=(1.0, 1.0, 1.0))])  # fmt: skip
    assert turning.coordinates == ("b.qw", "b.qx", "b.qy", "b.qz", "c")
    assert turning.velocities == ("b.wx", "b.wy", "b.wz", "c")
    with raises(dyn.MechanismError, match="a quaternion must not be zero"):
        _ = turning.lock("b", (0.0, 0.0, 0.0, 0.0)).coordinates
    with raises(dyn.MechanismError, match="no inertia"):
        _ = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=1.0)]).moving
