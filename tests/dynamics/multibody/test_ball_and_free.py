"""Ball and free joints: every graph against MuJoCo, against the other formulations, and against joints of one axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pytest import approx, importorskip, mark, param, raises

import dynamics as dyn
from cgraph import Graph
from dynamics.multibody.algebra.spatial import from_quaternion
from dynamics.multibody.bodies.joint_coordinates import per_velocity
from dynamics.peers.pinocchio_model import PinocchioModel
from dynamics.systems.system import System
from dynamics.verification.certificate import certify
from tests.dynamics.models import Array

ROUNDING = 1e-12  # of the largest of its kind, in some hundred sums


def random_tree(seed: int, base: str = "free", most: int = 5) -> dyn.Mechanism:
    """A tree of ball joints, hinges, slides and welds on a base of that kind, with springs, damping and armature."""
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(int(rng.integers(1, most + 1))):
        kind = str(rng.choice(["ball", "revolute", "prismatic", "fixed"], p=(0.3, 0.3, 0.3, 0.1))) if i else base
        points = rng.normal(size=(6, 3))
        free = kind.startswith("free")
        joint = dyn.Joint(
            kind,
            axis=rng.normal(size=3),
            position=np.zeros(3) if free else rng.normal(size=3),
            orientation=np.eye(3) if free else from_quaternion(rng.normal(size=4)),
            damping=float(rng.uniform(0.0, 0.3)),
            armature=0.0 if "axes" in kind else float(rng.uniform(0.0, 0.1)),
        )
        if joint.type.sprung:
            stiffness, reference = rng.uniform(0.0, 0.5, 2).tolist()
            joint = replace(joint, stiffness=stiffness, spring_reference=reference * (kind != "ball"))
        inertia = 0.1 * sum([(p @ p) * np.eye(3) - np.outer(p, p) for p in points])
        parent = f"b{rng.integers(max(0, i - 2), i)}" if i else "world"
        bodies.append(dyn.Body(f"b{i}", joint, parent, float(rng.uniform(0.5, 2.0)), 0.3 * rng.normal(size=3), inertia))
    return dyn.Mechanism(bodies, gravity=(0.3, -0.2, -9.81))


def state(system: System, seed: int, **more: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    sizes = {"q": system.nq, "qd": system.n} | dict.fromkeys(more, system.n)
    return {f"{name}{i}": float(x) for name, size in sizes.items() for i, x in enumerate(rng.normal(size=size))}


def values(graph: Graph, at: dict[str, float]) -> Array:
    return np.array(list(graph.evaluate({name: at[name] for name in graph.input_names}).values()))


def near(a: Array, b: Array) -> bool:
    return bool(np.abs(a - b).max() <= ROUNDING * np.abs(b).max())


@mark.parametrize("base", ["free", "ball", "free (body axes)", "revolute"])
@mark.parametrize("seed", [0, param(1, marks=mark.slow)])
def test_its_certificate_holds(base: str, seed: int) -> None:
    certificate = certify(random_tree(seed, base, most=2), states=2, seed=seed)
    assert certificate.passed, str(certificate)


@mark.parametrize("count", [3, param(60, marks=[mark.slow, mark.timeout(600)])])
def test_pinocchio_s_derivatives_are_ours(count: int, record_property: Callable[[str, object], None]) -> None:
    """Of accelerations by small displacements, which both have in the body's axes, by velocities and by torques."""
    pinocchio = importorskip("pinocchio")
    worst = 0.0
    for seed in range(count):
        tree = random_tree(seed, ["free (body axes)", "ball", "revolute"][seed % 3], most=3)
        joints = [
            replace(body.joint, stiffness=body.joint.stiffness * (body.joint.kind != "ball")) for body in tree.bodies
        ]
        bodies = [replace(body, joint=joint) for body, joint in zip(tree.bodies, joints, strict=True)]
        mechanism = replace(tree, bodies=bodies)  # the slope of a ball's spring is no diagonal
        n, nq, theirs = mechanism.system.n, mechanism.system.nq, PinocchioModel(mechanism)
        x = np.array(list(state(mechanism.system, seed, tau=1).values()))
        q, u, tau = x[:nq], x[nq : nq + n], x[nq + n :]
        A, B = dyn.linearize(mechanism, q, u, tau)
        joints = [body.joint for body in mechanism.moving]
        springs = np.array(per_velocity(mechanism.moving, [joint.stiffness for joint in joints]))
        damping = np.array(mechanism.system.damping)
        applied = tau - damping * u - (values(dyn.bias(mechanism), at_rest(q, n)) - springless(mechanism, q))
        at, data = theirs.q(q), theirs.model.createData()
        by_q, by_v, inverse = pinocchio.computeABADerivatives(
            theirs.model, data, at, theirs.v(at, u), theirs.v(at, applied)
        )
        rows = np.ix_(theirs.order, theirs.order)
        inverse = (np.triu(inverse) + np.triu(inverse, 1).T)[rows]
        expected = np.hstack([by_q[rows] - inverse * springs, by_v[rows] - inverse * damping, inverse])
        ours = np.hstack([A[n:], B[n:]])
        worst = max(worst, float(np.abs(ours - expected).max() / np.abs(expected).max()))
    record_property("worst", worst)
    assert worst <= ROUNDING


def at_rest(q: Array, n: int) -> dict[str, float]:
    return {f"q{i}": float(x) for i, x in enumerate(q)} | {f"qd{i}": 0.0 for i in range(n)}


def springless(mechanism: dyn.Mechanism, q: Array) -> Array:
    """The bias at rest of the mechanism without its springs."""
    bodies = [replace(body, joint=replace(body.joint, stiffness=0.0)) for body in mechanism.bodies]
    bare = replace(mechanism, bodies=bodies)
    return values(dyn.bias(bare), at_rest(q, bare.system.n))


@mark.parametrize("base", ["free", "ball", "free (body axes)"])
def test_bodies_state_the_bias_that_the_lagrangian_has(base: str) -> None:
    mechanism = random_tree(7, base, most=3)
    system = mechanism.system
    derived = System(
        lambda q, u, t: list(system.partial_lagrangians),
        system.coordinates,
        quasi_velocities=system.kinematics.quasi,  # whose brackets are compared with the structure
    )
    at = state(system, 1, qdd=1)
    assert near(values(dyn.bias(mechanism), at), values(dyn.bias(derived), at))
    undamped = values(dyn.inverse_dynamics(derived, "chain_rule_literal"), at)
    damping = np.array(system.damping) * [at[f"qd{i}"] for i in range(system.n)]
    assert near(values(dyn.inverse_dynamics(mechanism), at), undamped + damping)


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


def test_both_conventions_of_a_free_joint_accelerate_alike() -> None:
    tree = random_tree(11)
    first, *others = tree.bodies
    world, body = (
        dyn.Mechanism([replace(first, joint=dyn.Joint(kind)), *others], tree.gravity)
        for kind in ("free", "free (body axes)")
    )
    at = state(world.system, 4) | {f"tau{i}": 0.0 for i in range(world.system.n)}
    turn = from_quaternion([at[f"q{i}"] for i in range(3, 7)])
    v, w = (np.array([at[f"qd{i}"] for i in range(k, k + 3)]) for k in (0, 3))
    in_body = at | {f"qd{i}": float(x) for i, x in enumerate(turn.T @ v)}
    theirs, ours = values(dyn.forward_dynamics(body), in_body), values(dyn.forward_dynamics(world), at)
    assert near(turn @ (theirs[:3] + np.cross(w, turn.T @ v)), ours[:3])
    assert near(theirs[3:], ours[3:])


def test_three_hinges_are_a_ball_away_from_their_lock() -> None:
    """Inverse dynamics in the angles is J^T of that of the ball, for omega = J(angles) rates."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    inertia, center = (0.3, 0.4, 0.5), (0.1, 0.2, -0.3)
    hinges = [dyn.Body(f"h{i}", dyn.Joint("revolute", axis), f"h{i - 1}" if i else "world") for i, axis in
              enumerate(axes)]  # fmt: skip
    hinges[2] = dyn.Body("h2", hinges[2].joint, "h1", 2.0, center, inertia)
    serial = dyn.Mechanism(hinges)
    ball = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=2.0, center=center, inertia=inertia)])
    at = state(serial.system, 5, tau=1) | {"q0": 0.4, "q1": -0.7, "q2": 1.1, "tau0": 0.0, "tau1": 0.0, "tau2": 0.0}
    moved = serial.motion("h2").evaluate({k: x for k, x in at.items() if k[0] == "q" and "qdd" not in k})
    turn = np.array([[moved[f"R_{i}_{j}"] for j in range(3)] for i in range(3)])
    omega = turn.T @ [moved[name] for name in ("wx", "wy", "wz")]
    from dynamics.multibody.algebra.spatial import to_quaternion

    start = {f"q{i}": float(x) for i, x in enumerate(to_quaternion(turn))}
    start |= {f"qd{i}": float(x) for i, x in enumerate(omega)} | {f"tau{i}": 0.0 for i in range(3)}
    energies = [dyn.energy(each).evaluate({k: x for k, x in given.items() if k[0] == "q"})["E"]
                for each, given in ((serial, at), (ball, start))]  # fmt: skip
    assert abs(energies[0] - energies[1]) <= ROUNDING * abs(energies[0])
    step = 1e-4  # of the rate of omega along the hinges' motion
    qdd = values(dyn.forward_dynamics(serial), at)
    rates = []
    for sign in (-1.0, 1.0):
        h = sign * step
        then = {f"q{i}": at[f"q{i}"] + h * at[f"qd{i}"] + 0.5 * h * h * qdd[i] for i in range(3)}
        then |= {f"qd{i}": at[f"qd{i}"] + h * qdd[i] for i in range(3)}
        moved = serial.motion("h2").evaluate(then)
        axes_then = np.array([[moved[f"R_{i}_{j}"] for j in range(3)] for i in range(3)])
        rates.append(axes_then.T @ [moved[name] for name in ("wx", "wy", "wz")])
    alpha = (rates[1] - rates[0]) / (2.0 * step)
    assert np.abs(alpha - values(dyn.forward_dynamics(ball), start)).max() <= 1e-6 * np.abs(alpha).max()


def test_what_joints_of_several_freedoms_cannot_have_is_said() -> None:
    with raises(dyn.MechanismError, match=r"a joint of the kind 'free' has no spring, got stiffness 1.0"):
        _ = dyn.Mechanism([dyn.Body("b", dyn.Joint("free", stiffness=1.0), inertia=(1.0, 1.0, 1.0))]).coordinates
    turning = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=1.0, inertia=(1.0, 1.0, 1.0)),
                             dyn.Body("c", dyn.Joint("revolute"), "b", inertia=(1.0, 1.0, 1.0))])  # fmt: skip
    assert turning.coordinates == ("b.qw", "b.qx", "b.qy", "b.qz", "c")
    assert turning.velocities == ("b.wx", "b.wy", "b.wz", "c")
    with raises(dyn.MechanismError, match="a quaternion must not be zero"):
        _ = turning.lock("b", (0.0, 0.0, 0.0, 0.0)).coordinates
    with raises(dyn.MechanismError, match=r"must be \(4,\) finite numbers"):
        _ = turning.lock("b", 0.3).coordinates
    with raises(dyn.MechanismError, match="no inertia"):
        _ = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=1.0)]).moving


def test_a_locked_ball_is_the_weld_that_it_stands_at() -> None:
    turning = dyn.Mechanism([dyn.Body("b", dyn.Joint("ball"), mass=1.0, inertia=(1.0, 1.0, 1.0)),
                             dyn.Body("c", dyn.Joint("revolute", position=(0.0, 0.0, 1.0)), "b", mass=1.0,
                                      center=(0.1, 0.0, 0.0))])  # fmt: skip
    e = (2.0, 0.6, -0.4, 0.2)
    locked = turning.lock("b", e)
    place = turning.position("c", (0.1, 0.2, 0.3)).evaluate({f"q{i}": x for i, x in enumerate((*e, 0.5))})
    weld = locked.position("c", (0.1, 0.2, 0.3)).evaluate({"q0": 0.5})
    assert near(np.array(list(weld.values())), np.array(list(place.values())))
    q, qd = turning.map_state_from(locked, [0.5], [1.0])
    assert q.tolist() == [*e, 0.5]
    assert qd.tolist() == [0.0, 0.0, 0.0, 1.0]
    assert turning.lock("b").unlock("b").coordinates == turning.coordinates
