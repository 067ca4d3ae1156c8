"""Mechanisms written and read again: random trees of any size and scale are the same, or are refused in a sentence."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pytest import importorskip, mark, raises

import dynamics as dyn
from dynamics import Body, Joint, Loop, Mechanism, MechanismError
from dynamics.multibody.trees.mechanism import WORLD
from tests.dynamics.mechanisms import FAMILIES, random_inertia, random_rotation
from tests.each_row import each_row

EPS = 2.0**-52
TURNED = 8 * EPS  # axes and rotations: angles or a quaternion, and their sines or squares, a few roundings each; what
# comes back is a rotation, and so off by what the matrix that was written is off from one, too
MOMENTS = 16 * EPS  # of the largest moment: besides, principal axes and back
EXACT = ("damping", "stiffness", "spring_reference", "armature")
importorskip("mujoco")


def random_tree(seed: int, geared: bool) -> Mechanism:
    """Joints of all kinds, of one scale of mass and of length; massless links, point masses, rods and plates.

    geared: with springs and armatures.
    """
    rng = np.random.default_rng(seed)
    kilogram, meter = 10.0 ** rng.uniform(-12, 12), 10.0 ** rng.uniform(-9, 9)
    bodies: list[Body] = []
    for i in range(int(rng.integers(1, 9))):
        kind = str(rng.choice(["revolute", "revolute", "prismatic", "fixed"], p=(0.3, 0.3, 0.2, 0.2)))
        whole = rng.uniform() < 0.15
        kind = str(rng.choice(["ball", "free", "free (body axes)"], p=(0.5, 0.4, 0.1))) if whole else kind
        turn = random_rotation(rng) if rng.uniform() < 0.7 else np.eye(3)[rng.permutation(3)]
        turn = turn * np.linalg.det(turn)
        place = meter * rng.normal(size=3)
        parent = f"b{rng.integers(max(0, i - 3), i)}" if i and rng.uniform() < 0.9 else WORLD
        parent = bodies[-1].name if i and not bodies[-1].mass else parent  # what has no mass carries some
        if kind == "free" and rng.uniform() < 0.8:
            parent, place, turn = WORLD if not i or bodies[-1].mass else parent, np.zeros(3), np.eye(3)
        joint = Joint(kind, rng.normal(size=3), place, turn, damping=rng.uniform())
        if geared and kind != "fixed":
            armature, stiffness, reference = rng.uniform(size=3) * (joint.type.geared, joint.type.sprung, not whole)
            joint = replace(joint, armature=armature, stiffness=stiffness, spring_reference=reference)
        moments = [
            random_inertia(rng),
            np.zeros(3),
            rng.uniform() * np.array([1.0, 1.0, 0.0]),
            np.array([0.1, 0.7, 0.8]),
        ][0 if whole else rng.integers(4)]
        mass = kilogram * rng.uniform(0.5, 2.0) * (whole or rng.uniform() < 0.8)
        inertia = kilogram * meter**2 * moments * (mass > 0)
        bodies.append(Body(f"b{i}", joint, parent, mass, meter * rng.normal(size=3) * (mass > 0), inertia, i / 4))
    tip = Body("tip", Joint("revolute", rng.normal(size=3)), f"b{len(bodies) - 1}", kilogram, (meter, 0, meter))
    return Mechanism([*bodies, replace(tip, inertia=kilogram * meter**2 * random_inertia(rng))], rng.normal(size=3))


def random_loops(tree: Mechanism, seed: int) -> Mechanism:
    """The tree with joints that follow earlier ones, and with free bodies that are held to some of its bodies."""
    rng = np.random.default_rng((seed, 1))
    meter = float(np.abs(tree.parts[-1].center).max())
    bodies, loops = [*tree.bodies], []
    single = [body.name for body in tree.moving if len(body.joint.type.coordinates) == 1]
    for k, follower in enumerate(single[1:], 1):
        if rng.uniform() < 0.5:
            leader = single[rng.integers(k)]
            line = rng.normal(size=rng.choice([2, 5])).tolist()
            loops.append(Loop("coupling", follower, leader, coefficients=line, name=str(rng.choice(["", f"<{k}>"]))))
    if len(single) > 1 and not loops:
        loops.append(Loop("coupling", single[0], coefficients=[rng.normal()]))
    for k in range(int(rng.integers(3))):
        kind, held = str(rng.choice(["point", "weld", "hinge"], p=(0.45, 0.45, 0.1))), f"held {k}"
        bodies.append(replace(tree.parts[-1], name=held, joint=Joint("free"), parent=WORLD))
        at, to_at = meter * rng.normal(size=(2, 3))
        to = str(rng.choice([body.name for body in tree.bodies] + [WORLD]))
        ends = (held, to) if to == WORLD or rng.uniform() < 0.5 else (to, held)
        loops.append(Loop(kind, *ends, at, to_at, orientation=random_rotation(rng), name=f"loop {k}"))
    return Mechanism(bodies, tree.gravity, loops=loops)


def other_loops(one: Mechanism, other: Mechanism) -> str:
    """The first loop that is not the same in two mechanisms; "" for none."""
    if len(one.loops) != len(other.loops):
        return "the number of loops"
    theirs = {loop.label: loop for loop in other.loops}
    for a in one.loops:
        b = theirs[a.label]
        turns = [np.asarray(loop.orientation) * (loop.kind == "weld") for loop in (a, b)]
        same = (
            (a.body, a.to, a.kind) == (b.body, b.to, b.kind)
            and np.array_equal(a.at, b.at)
            and np.array_equal(a.to_at, b.to_at)
            and np.abs(turns[0] - turns[1]).max() <= TURNED
        )
        same &= a.kind != "coupling" or [*a.coefficients] == [*b.coefficients]
        if not same:
            return f"{a} and {b}"
    return ""


def difference(one: Mechanism, other: Mechanism) -> str:
    """What is not the same in two mechanisms; "" for nothing."""
    if np.asarray(one.gravity).tolist() != np.asarray(other.gravity).tolist():
        return "gravity"
    ours, theirs = ({body.name: body for body in each.parts} for each in (one, other))
    if set(ours) != set(theirs) or set(one.coordinates) != set(other.coordinates):
        return "names"
    for name, a in ours.items():
        b, size = theirs[name], float(np.abs(a.inertia).max())
        same = (a.parent, a.mass, a.joint.kind) == (b.parent, b.mass, b.joint.kind)
        same &= a.gravity_compensation == b.gravity_compensation
        same &= np.array_equal(a.center, b.center) and np.array_equal(a.joint.position, b.joint.position)
        turn = np.asarray(a.joint.orientation)
        defect = float(np.abs(turn.T @ turn - np.eye(3)).max())
        same &= bool(np.abs(turn - b.joint.orientation).max() <= TURNED + defect)
        same &= bool(np.abs(np.asarray(a.inertia) - b.inertia).max() <= MOMENTS * size)
        if a.joint.type.moves:
            same &= a.coordinate == b.coordinate and all(getattr(a.joint, n) == getattr(b.joint, n) for n in EXACT)
            off = np.abs(np.asarray(a.joint.axis) - b.joint.axis).max()
            same &= not a.joint.type.has_axis or bool(off <= TURNED)
        if not same:
            return f"{a} and {b}"
    return ""


def outcomes(seeds: range, *, closed: bool = False) -> dict[str, list[Any]]:
    """Seeds of the trees that came back, that were refused and that were altered.  closed: with loops."""
    found: dict[str, list[Any]] = {"same": [], "refused": [], "altered": []}
    for seed in seeds:
        mechanism = random_tree(seed, geared=seed % 2 > 0)
        mechanism = random_loops(mechanism, seed) if closed else mechanism
        try:
            text = dyn.to_mjcf(mechanism)
        except MechanismError as error:
            found["refused"].append((seed, str(error)))
            continue
        back = dyn.load_mjcf(text)
        what = difference(mechanism, back) or other_loops(mechanism, back)
        found["altered" if what else "same"].append((seed, what))
    return found


SOFT = mark.filterwarnings("ignore:the given text. left out softness:dynamics.MechanismWarning")
TRIED = [(False, 30, 8), pytest.param(True, 4, 1, marks=SOFT)]  # with loops, how many, and how many at least come back
TRIED += [pytest.param(False, 300, 76, marks=mark.slow), pytest.param(True, 200, 25, marks=(mark.slow, SOFT))]


@mark.filterwarnings("ignore:MuJoCo on the given text. Inertia matrix is too close to singular")
@mark.parametrize(("closed", "count", "least"), TRIED)
def test_random_trees_and_loops_come_back_or_are_refused(
    closed: bool, count: int, least: int, record_property: Any
) -> None:
    found = outcomes(range(count), closed=closed)
    record_property("refused", len(found["refused"]))
    assert found["altered"] == []
    assert not any("\n" in sentence for _, sentence in found["refused"])
    assert len(found["same"]) >= least


@each_row(
    ("loops", "message"),
    [
        ([Loop("distance", "b", "a", length=1.0, name="rod")], "MJCF has no loop of the kind 'distance', as is 'rod'"),
        ([Loop("coupling", "b", "a", coefficients=[0, 1, 0, 0, 0, 2], name="cam")], "loop 'cam' is of more"),
        ([Loop("coupling", "b", "c", name="gear")], "loop 'gear' couples that of 'b'"),
    ],
)
def test_a_loop_that_mjcf_has_not_is_refused_by_name(loops: list[Loop], message: str) -> None:
    bodies = [Body(name, Joint("revolute"), inertia=(1.0, 1.0, 1.0)) for name in "abcd"]
    with raises(MechanismError, match=re.escape(message)):
        dyn.to_mjcf(Mechanism(bodies, loops=loops).lock("c", 0.3))


def test_welds_frames_and_locks_come_back() -> None:
    """A frame without mass keeps its name; a locked joint is a weld where it stands."""
    frame = Body("tool0", Joint("fixed", position=(0.1, 0.2, 0.3)), "b4")
    mechanism = Mechanism([*FAMILIES["welded"](6).bodies, frame]).lock("b1", 0.3)
    back = dyn.load_mjcf(dyn.to_mjcf(mechanism))
    assert difference(mechanism, back) == ""
    assert [body.name for body in back.bodies if not body.joint.type.moves] == ["b1", "b2", "b5", "tool0"]


@mark.parametrize(
    ("fields", "message"),
    [
        ({"mass": 1e-20, "inertia": (1, 1, 1)}, "and body 'a' has a mass of 1e-20 kg"),
        ({"mass": 1.0, "inertia": (1, 1, 1e-16)}, "and body 'a' has a moment of inertia of 1e-16 kg m^2"),
        ({"mass": 1e-9, "center": (1e-6, 0, 0)}, "and body 'a' has a moment of inertia of 0, where 1e-21 kg m^2 turn"),
        ({"mass": 1.0, "inertia": (1, 2, 4)}, "MuJoCo takes no body with principal moments [1.0, 2.0, 4.0], as"),
    ],
)
@mark.filterwarnings("ignore:body 'a'. no body has:dynamics.MechanismWarning")
def test_what_mujoco_does_not_take_is_refused(fields: dict[str, Any], message: str) -> None:
    spin = Body("base", Joint("revolute", (1.0, 0.0, 0.0)), mass=1.0, inertia=(1, 1, 1))
    with raises(MechanismError, match=re.escape(message)):
        dyn.to_mjcf(Mechanism([spin, Body("a", Joint("revolute", (0.0, 1.0, 1.0)), "base", **fields)]))
