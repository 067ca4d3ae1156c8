"""Structure that changes: joints locked and freed, bodies hung on and taken off, and what carries over."""

import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from pytest import approx, mark, raises

import dynamics as dyn
from cgraph import structure_hash
from dynamics.multibody.bodies.body import WORLD
from tests.dynamics.mechanisms import EVERY_KIND, random_body, random_inertia, random_tree
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
    assert [part.tolist() for part in held.map_state_from(free, *whole[:2])] == [q.tolist(), qd.tolist()]
    with raises(ValueError, match=r"qd must have shape \(2,\)"):
        free.map_state_from(held, q, [0.0])
    assert free.lock("b1").unlock("b1").coordinates == free.coordinates
    if len(where) > 1:
        with raises(dyn.MechanismError, match=rf"joint of body 'b1': .* must be \({len(where)},\) finite numbers"):
            _ = free.lock("b1", 0.3).coordinates


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


def test_a_change_that_cannot_be_is_refused_in_the_same_words_by_rows_which_stay_as_they_are() -> None:
    whole, spare = arm(3).attach(TOOL, to="link 3"), replace(TOOL, name="spare")
    rows, motion = dyn.Rows(whole), np.full((3, 3), 0.2)
    before = rows.inverse(*motion)
    for change, said in (
        (lambda m: m.lock("nobody"), "there is no body 'nobody' to lock"),
        (lambda m: m.lock("tool"), "body 'tool' is welded on and has no joint to lock"),
        (lambda m: m.lock("link 1", math.nan), "locked at a finite number, got nan"),
        (lambda m: m.unlock("link 1"), "the joint of body 'link 1' is not locked"),
        (lambda m: m.detach("nobody"), "there is no body 'nobody' in the mechanism"),
        (lambda m: m.with_body(spare), "there is no body 'spare' in the mechanism"),
        (lambda m: m.attach(replace(spare, parent="nobody")), "body 'spare' has the unknown parent 'nobody'"),
        (lambda m: m.attach(whole.bodies[0], to="link 3"), "two bodies have the name 'link 1'"),
        (lambda m: m.attach(replace(spare, mass=-1.0), to="link 3"), "body 'spare': mass must be finite"),
        (lambda m: m.attach(dyn.Body("c", dyn.Joint("revolute"), "link 3")), "body 'c' has no mass, carries no mass"),
        (lambda m: m.attach([], to="link 3"), r"a subtree is a body, or several .* got \[\]"),
        (lambda m: m.attach(3.0), "a subtree is a body, or several .* got 3.0"),
    ):
        for model in (whole, rows):
            with raises(dyn.MechanismError, match=said):
                _ = change(model).moving
    assert np.array_equal(rows.inverse(*motion), before)
    with raises(dyn.MechanismError, match="there is no body 'nobody' in the mechanism"):
        whole.subtree("nobody")


def parents(m: dyn.Mechanism) -> dict[str, str]:
    return {body.name: body.parent for body in m.bodies}


def numbers(m: dyn.Mechanism) -> list[object]:
    carriers = [(name, at.name, *at.position, *at.orientation.flat) for name, at in m.carriers.items()]
    return [{b.name: b.parent for b in m.moving}, [x.numbers for x in m.bind().links], carriers, m.parents, m.limits]


@mark.parametrize("seed", [*range(6), *slow(*range(6, 40))])
def test_a_changed_mechanism_is_the_one_made_anew(seed: int) -> None:
    """A subtree hangs where it is put, and back where it was it stands among the others as before."""
    rng, m = np.random.default_rng(seed), random_tree(seed, 4, EVERY_KIND)
    m = replace(m, bodies=[replace(m.bodies[0], mass="m"), *m.bodies[1:]], parameters={"m": 2.0}) if seed % 2 else m
    for kind in rng.permutation(9 * ["lock", "unlock", "attach", "detach", "move"]):
        at, first = str(rng.choice([body.name for body in m.bodies])), m.bodies[0].name
        new = random_body(f"{at}+", str(rng.choice(["revolute", "fixed"])), at, rng)
        given = {"attach": [new], "lock": [at, rng.normal()], "unlock": [next(iter(m.locked), at)]}.get(kind, [at])
        with suppress(dyn.MechanismError):  # such as what would move no mass
            less = m.detach(at) if at != first else m
            if kind == "move":
                back, moved = (less.attach(m.subtree(at), to=to) for to in (None, first))
                assert list(parents(back).items()) == list(parents(m).items())
                assert parents(moved) == parents(m) | {at: first}
            m = moved if kind == "move" else less if kind == "detach" else getattr(m, kind)(*given)
        assert numbers(m) == numbers(replace(m, bodies=[replace(b, joint=replace(b.joint)) for b in m.bodies]))


def test_a_mechanism_is_not_changed_by_its_changes() -> None:
    old = arm(3)
    first = structure_hash(dyn.inverse_dynamics(old))
    old.lock("link 1").attach(TOOL, to=WORLD).detach("link 3")
    assert structure_hash(dyn.inverse_dynamics(old)) == first
