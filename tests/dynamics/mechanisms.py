"""Mechanisms for tests: random trees and chains, and arms with quarter turns."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

import dynamics as dyn
from dynamics import Body, Joint, Mechanism
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.bodies.joint_coordinates import places
from dynamics.multibody.joints import TYPES
from dynamics.multibody.trees.mechanism import WORLD
from tests.slow import slow

Array = np.ndarray[Any, np.dtype[np.float64]]


PITCH = 0.3  # m/rad, of screws


def random_inertia(rng: np.random.Generator) -> Array:
    """(3, 3) [kg m^2], of a body that can be: J = tr(S) - S of a positive definite second moment of mass S."""
    mixed = rng.normal(size=(3, 3))
    second = 0.05 * mixed @ mixed.T + 0.01 * np.eye(3)
    return np.trace(second) * np.eye(3) - second


def random_rotation(rng: np.random.Generator) -> Array:
    axis = rng.normal(size=3)
    return rotation(axis / np.linalg.norm(axis), rng.uniform(-3.0, 3.0))


def random_joint(kind: str, rng: np.random.Generator, **others: Any) -> Joint:
    """A joint about any axis, anywhere, with damping, spring and armature."""
    numbers = {
        "damping": rng.uniform(),
        "stiffness": rng.uniform(),
        "spring_reference": rng.normal(),
        "armature": rng.uniform(),
        "pitch": PITCH if kind == "screw" else 0.0,
        "axis": rng.normal(size=3),
        "position": 0.3 * rng.normal(size=3),
        "orientation": random_rotation(rng),
    }
    return Joint(kind, **(numbers | others))


def random_body(name: str, kind: str, parent: str, rng: np.random.Generator, **others: Any) -> Body:
    given = {"mass": rng.uniform(0.5, 2.0), "center": 0.2 * rng.normal(size=3), "inertia": random_inertia(rng)}
    return Body(name, others.pop("joint", None) or random_joint(kind, rng), parent, **(given | others))


def random_mechanism(n: int, kinds: Sequence[str], reach: int, seed: int = 0) -> Mechanism:
    """n bodies of the kinds in turn, each on one of the `reach` bodies before it; any gravity."""
    rng = np.random.default_rng((n, reach, seed))
    bodies = []
    for i in range(n):
        kind = kinds[i % len(kinds)]
        parent = f"b{rng.integers(max(0, i - reach), i)}" if i else WORLD
        bodies.append(random_body(f"b{i}", kind, parent, rng))
    return Mechanism(bodies, 5.0 * rng.normal(size=3))


FAMILIES: dict[str, Callable[[int], Mechanism]] = {
    "serial": lambda n: random_mechanism(n, ["revolute"], 1),
    "mixed": lambda n: random_mechanism(n, ["revolute", "prismatic"], 1),
    "branched": lambda n: random_mechanism(n, ["revolute"], 4),
    "welded": lambda n: random_mechanism(n, ["revolute", "prismatic", "fixed"], 3),
}
FAMILIES = {name: cache(make) for name, make in FAMILIES.items()}  # one model, which keeps what is derived of it
PLAIN = ("serial", "branched")  # of hinges alone, which the others have too
EVERY_FAMILY = [*[name for name in FAMILIES if name not in PLAIN], *slow(*PLAIN)]


def turned_link(i: int, rng: np.random.Generator) -> dict[str, Any]:
    """The i-th link of an arm whose frames are turned by quarter turns, with a full inertia."""
    turn = rotation(np.array([1.0, 0.0, 0.0]), (0.0, math.pi / 2, -math.pi / 2)[i % 3])
    joint = Joint("revolute", position=(0.1, 0.0, 0.3) if i else (0.0, 0.0, 0.0), orientation=turn)
    center = 0.1 * rng.normal(size=3)
    return {"joint": joint, "mass": rng.uniform(1.0, 2.0), "center": center, "inertia": random_inertia(rng)}


def turned_arm(n: int) -> Mechanism:
    """n revolute joints one after the other."""
    rng = np.random.default_rng(n)
    return dyn.serial_arm([turned_link(i, rng) for i in range(n)])


def turned_tree(n: int) -> Mechanism:
    """n revolute joints, two on each until there are n."""
    rng = np.random.default_rng(n)
    return dyn.tree([(i - 1) // 2 for i in range(n)], [turned_link(i, rng) for i in range(n)])


TREE_KINDS = ["revolute", "prismatic", "ball", "fixed"]
EVERY_KIND = [*TREE_KINDS, "screw", "cylindrical", "universal", "planar"]


def random_tree(seed: int, n: int, among: Sequence[str] = TREE_KINDS, base: str | None = None) -> Mechanism:
    """n bodies of some kinds on chains, branches or all on one, on that base, else two in five on one that is free.

    Joints have damping, armature where they can, and springs where they can have any.
    """
    rng = np.random.default_rng((seed, n))
    kinds = ["revolute", *rng.permutation(among)[: rng.integers(1, 4)].tolist()]
    drawn = rng.choice(["free", "free (body axes)", "", "", ""])
    base = drawn if base is None else base
    reach, bodies = int(rng.choice([1, 2, 4, n])), []
    for i in range(n):
        kind = str(base or "revolute") if i == 0 else str(rng.choice(kinds))
        parent = f"b{rng.integers(max(0, i - reach), i)}" if i else WORLD
        own = TYPES.get(kind, TYPES["revolute"])  # of a composed joint, that of its parts
        others: dict[str, object] = {} if own.sprung and kind != "ball" else {"stiffness": 0.0, "spring_reference": 0.0}
        others |= {} if own.geared and own.moves else {"armature": 0.0}
        if kind in ("universal", "planar"):
            others["axis"], others["second_axis"] = random_rotation(rng)[:2]
        bodies.append(random_body(f"b{i}", kind, parent, rng, joint=random_joint(kind, rng, **others)))
    return Mechanism(bodies, 5.0 * rng.normal(size=3))


def for_peers(tree: Mechanism, seed: int) -> Mechanism:
    """With springs at balls; free bodies stand at the origin of the world, in its axes, as MuJoCo has them."""
    rng, bodies = np.random.default_rng(seed), []
    for body in tree.bodies:
        joint = body.joint
        if joint.kind == "ball":
            joint = replace(joint, stiffness=float(rng.uniform(0.0, 0.5)))
        if joint.kind.startswith("free"):
            joint = replace(joint, position=np.zeros(3), orientation=np.eye(3))
        bodies.append(replace(body, joint=joint))
    return replace(tree, bodies=bodies)


def random_state(tree: Mechanism, seed: int) -> tuple[Array, Array, Array, Array]:
    """q, quaternions of length 1, and normal qd, qdd and tau."""
    rng, system = np.random.default_rng(seed), tree.system
    q = np.array(system.kinematics.neutral) + rng.uniform(-1.0, 1.0, system.nq)
    for body, place in zip(tree.moving, places(tree.moving), strict=True):
        if len(body.joint.type.coordinates) > 3:
            turn = q[place.q][-4:]
            turn /= np.linalg.norm(turn)
    qd, qdd, tau = rng.normal(size=(3, system.n))
    return q, qd, qdd, tau


def floating(kind: str, tree: Mechanism, on: str = "world") -> Mechanism:
    """The tree on a body that moves freely, or that body on one of the tree."""
    joint = Joint(kind, position=(0.1, 0.2, 0.3), orientation=tree.bodies[0].joint.orientation, damping=0.3)
    free = random_body("free", kind, on, np.random.default_rng(0), joint=joint)
    carried = [replace(body, parent="free") if on == body.parent == "world" else body for body in tree.bodies]
    return Mechanism([*carried, free], tree.gravity)


def forest(tree: Mechanism) -> Mechanism:
    """The mechanism with its third body, and what that carries, on the world."""
    first, second, third, *others = tree.bodies
    return Mechanism([first, second, replace(third, parent="world"), *others], tree.gravity)


TREES: dict[str, Callable[[], Mechanism]] = {
    "hinges": lambda: random_mechanism(4, ["revolute"], 1),
    "hinges and slides": lambda: random_mechanism(5, ["revolute", "prismatic"], 3),
    "balls": lambda: random_mechanism(3, ["ball", "revolute"], 2),
    "a ball on a slide": lambda: random_mechanism(2, ["prismatic", "ball"], 1),
    "a free base": lambda: floating("free", random_mechanism(3, ["revolute", "prismatic"], 2)),
    "a free base in its own axes": lambda: floating("free (body axes)", random_mechanism(2, ["revolute"], 1)),
    "free on a hinge": lambda: floating("free", random_mechanism(1, ["revolute"], 1), on="b0"),
    "fixed": lambda: random_mechanism(5, ["revolute", "fixed", "prismatic"], 2),
    "turned by quarters": lambda: turned_arm(4),
    "trees": lambda: forest(random_mechanism(4, ["revolute", "prismatic"], 1)),
}
TREES = {name: cache(make) for name, make in TREES.items()}  # one model, which keeps what is derived of it
