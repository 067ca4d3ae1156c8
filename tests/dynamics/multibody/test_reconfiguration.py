"""Structure that changes: joints locked and freed, bodies hung on and taken off, and what carries over."""

import math
from dataclasses import replace

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from cgraph import structure_hash
from dynamics.multibody.bodies.body import WORLD
from tests.dynamics.mechanisms import random_body, random_inertia, random_mechanism
from tests.each_row import each_row
from tests.slow import slow
from tests.tolerances import TORQUES

TOOL = dyn.Body("tool", dyn.Joint("fixed", position=(0.1, 0.0, -0.2)), mass=0.4, center=(0.0, 0.05, 0.0),
                inertia=(2e-3, 3e-3, 4e-3))  # fmt: skip


def arm(n: int, seed: int = 0) -> dyn.Mechanism:
    generator = np.random.default_rng(seed)
    links = []
    for i in range(n):
        inertia = random_inertia(generator)
        joint = dyn.Joint("revolute", generator.normal(size=3), (0.1, 0.0, 0.3) if i else (0.0, 0.0, 0.0), damping=0.1)
        center = 0.1 * generator.normal(size=3)
        links.append({"joint": joint, "mass": 1.0 + 0.1 * i, "center": center, "inertia": inertia})
    return dyn.serial_arm(links)


def torque(mechanism: dyn.Mechanism, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    return dyn.arrays_at(mechanism, dyn.inverse_dynamics(mechanism), q, qd, qdd)["tau"]


LOCKED: dict[str, tuple[float, ...]] = {
    "revolute": (0.7,),
    "prismatic": (-0.3,),
    "screw": (0.7,),
    "ball": (2.0, 0.6, -0.4, 0.2),
    "free": (0.1, 0.2, -0.3, 2.0, 0.6, -0.4, 0.2),
    "cylindrical": (0.3, -0.5),
    "universal": (0.3, -0.5),
    "planar": (0.3, -0.5, 0.8),
}


@each_row("kind, where", [*LOCKED.items()])
def test_a_locked_joint_is_the_limit_of_one_held_by_force(kind: str, where: tuple[float, ...]) -> None:
    """The torques of the others are those of the free mechanism with the joint at rest where it is locked."""
    rng = np.random.default_rng(2)
    first, middle, last = (random_body(f"b{i}", "revolute", f"b{i - 1}" if i else "world", rng) for i in range(3))
    across = {"second_axis": np.cross(middle.joint.axis, (1.0, 2.0, 3.0))} if kind in ("universal", "planar") else {}
    frame = {"position": middle.joint.position, "orientation": middle.joint.orientation}
    joint = dyn.Joint(kind, middle.joint.axis, pitch=0.3 * (kind == "screw"), **frame, **across)
    free = dyn.Mechanism([first, replace(middle, joint=joint), last])
    held = free.lock("b1", where[0] if len(where) == 1 else where)
    count, (q, qd, qdd) = free.system.n - 2, rng.normal(size=(3, 2))
    whole = [[q[0], *where, q[1]], *([rate[0], *[0.0] * count, rate[1]] for rate in (qd, qdd))]
    assert held.coordinates == ("b0", "b2")
    assert torque(held, q, qd, qdd) == approx(torque(free, *whole)[[0, -1]], rel=TORQUES)
    assert [part.tolist() for part in free.map_state_from(held, q, qd)] == whole[:2]
    assert free.lock("b1").unlock("b1").coordinates == free.coordinates
    if len(where) > 1:
        with raises(dyn.MechanismError, match=rf"joint of body 'b1': .* must be \({len(where)},\) finite numbers"):
            _ = free.lock("b1", 0.3).coordinates


def test_unlock_gives_the_free_mechanism_back() -> None:
    free = arm(4)
    again = free.lock("link 2", 0.4).lock("link 3", 0.1).unlock("link 2").unlock("link 3")
    assert structure_hash(dyn.inverse_dynamics(again)) == structure_hash(dyn.inverse_dynamics(free))


@mark.parametrize("seed", [0, *slow(*range(1, 6))])
def test_detach_then_attach_gives_the_same_graph(seed: int) -> None:
    whole = random_mechanism(9, ("revolute", "prismatic"), 3, seed)
    rng = np.random.default_rng(seed)
    hashes = [structure_hash(make(whole)) for make in (dyn.inverse_dynamics, dyn.mass_matrix)]
    for _ in range(3):
        name = whole.bodies[int(rng.integers(1, len(whole.bodies)))].name
        try:
            without = whole.detach(name)
            assert without.moving
        except (dyn.MechanismError, AssertionError):
            continue  # what is left would move no mass
        again = without.attach(whole.subtree(name))
        assert [body.name for body in again.bodies] == [body.name for body in whole.bodies]
        assert [structure_hash(make(again)) for make in (dyn.inverse_dynamics, dyn.mass_matrix)] == hashes


def test_a_subtree_can_hang_elsewhere() -> None:
    whole = arm(6)
    moved = whole.detach("link 4").attach(whole.subtree("link 4"), to="link 1")
    assert [(body.name, body.parent) for body in moved.moving][-3:] == [
        ("link 4", "link 1"), ("link 5", "link 4"), ("link 6", "link 5")]  # fmt: skip


def test_forces_parameters_and_locks_go_with_their_bodies() -> None:
    """Forces of every kind; that of a locked joint is none."""
    push, servo = dyn.Force("link 3", ("push", 0.0, 0.0)), dyn.Actuator("link 3", "target", gain=(9.0, 0.0, 0.0))
    between = dyn.Contact("link 1", "link 3", radius=0.1, to_radius=0.2, stiffness="k")
    others = dyn.Force("link 1", (0.0, "pull", 0.0)), dyn.JointLimit("link 2", -1.0, 1.0, 1e3)
    values = {"push": 2.0, "pull": 3.0, "target": 0.3, "k": 1e3}
    whole = dyn.Mechanism(arm(3).bodies, forces=[push, servo, between, *others], parameters=values).lock("link 3", 0.1)
    without, taken = whole.detach("link 3"), whole.subtree("link 3")
    assert (dict(without.parameters), without.forces, dict(without.locked)) == ({"pull": 3.0}, others, {})
    assert set(taken.forces) == {push, servo, between}
    again = without.attach(taken)
    assert (dict(again.parameters), set(again.forces)) == (values, {push, servo, between, *others})
    assert dict(again.locked) == {"link 3": 0.1}
    bare = replace(
        whole, forces=[push, between, *others], parameters={name: values[name] for name in ("push", "pull", "k")}
    )
    motion = np.full((3, 2), 0.2)
    assert np.array_equal(torque(whole, *motion), torque(bare, *motion))


def test_the_state_of_untouched_joints_carries_over() -> None:
    old = arm(4)
    q, qd = np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 2.0, 3.0, 4.0])
    held = old.lock("link 2", at=0.2)
    q_held, qd_held = held.map_state_from(old, q, qd)
    assert (q_held.tolist(), qd_held.tolist()) == ([0.1, 0.3, 0.4], [1.0, 3.0, 4.0])
    q_free, qd_free = held.unlock("link 2").map_state_from(held, q_held, qd_held)
    assert (q_free.tolist(), qd_free.tolist()) == ([0.1, 0.2, 0.3, 0.4], [1.0, 0.0, 3.0, 4.0])
    with raises(ValueError, match=r"qd must have shape \(4,\)"):
        held.map_state_from(old, q, [0.0])


@mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.lock("nobody"), "there is no body 'nobody' to lock"),
        (lambda m: m.attach(TOOL, to="link 3").lock("tool"), "body 'tool' is welded on and has no joint to lock"),
        (lambda m: m.lock("link 1", math.nan), "locked at a finite number, got nan"),
        (lambda m: m.unlock("link 1"), "the joint of body 'link 1' is not locked"),
        (lambda m: m.detach("nobody"), "there is no body 'nobody' in the mechanism"),
        (lambda m: m.subtree("nobody"), "there is no body 'nobody' in the mechanism"),
        (lambda m: m.attach(TOOL, to="nobody"), "body 'tool' has the unknown parent 'nobody'"),
        (lambda m: m.attach(m.bodies[0], to="link 3"), "two bodies have the name 'link 1'"),
        (lambda m: m.attach([], to="link 3"), r"a subtree is a body, or several .* got \[\]"),
        (lambda m: m.attach(3.0), "a subtree is a body, or several .* got 3.0"),
    ],
)
def test_a_change_that_cannot_be_is_refused(change, message) -> None:  # type: ignore[no-untyped-def]
    with raises(dyn.MechanismError, match=message):
        change(arm(3))


def test_wrong_use_of_torques_body_by_body() -> None:
    run = dyn.RecursiveInverseDynamics(arm(3))
    with raises(ValueError, match=r"qd must have shape \(3,\), one for each coordinate, got \(2,\)"):
        run([0.0] * 3, [0.0] * 2, [0.0] * 3)
    with raises(ValueError, match="does not take external forces"):
        dyn.RecursiveInverseDynamics(dyn.Mechanism(arm(2).bodies, forces=[dyn.Force("link 1", (1.0, 0.0, 0.0))]))


def test_a_mechanism_is_not_changed_by_its_changes() -> None:
    old = arm(3)
    first = structure_hash(dyn.inverse_dynamics(old))
    old.lock("link 1").attach(TOOL, to=WORLD).detach("link 3")
    assert structure_hash(dyn.inverse_dynamics(old)) == first
