"""Mechanisms for tests: random trees and chains, and arms with quarter turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import dynamics as dyn
from dynamics.multibody.mechanism import WORLD, Body, Joint, Mechanism
from dynamics.multibody.spatial import rotation

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
    }
    return Joint(kind, rng.normal(size=3), 0.3 * rng.normal(size=3), random_rotation(rng), **(numbers | others))


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
