"""The bias that mechanisms and planar arms give themselves, against what Lagrange's equation makes of their energy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pytest import approx, mark

import dynamics as dyn
from cgraph import Graph
from dynamics.multibody.trees.mechanism import WORLD, Body, Joint, Mechanism
from tests.dynamics.mechanisms import FAMILIES, PLAIN, random_body, random_mechanism, turned_arm, turned_tree
from tests.dynamics.models import Array
from tests.slow import slow

AGREEMENT = 1e-12  # of the largest force or acceleration: two ways of rounding


def in_a_plane_and_out() -> Mechanism:
    """Slides and hinges in one plane, then bodies that leave it, on both sides of a parallel axis the other way."""
    rng = np.random.default_rng(5)

    def body(name: str, kind: str, parent: str, axis: tuple[float, float, float]) -> Body:
        joint = Joint(kind, axis, 0.3 * rng.normal(size=3), stiffness=0.7, spring_reference=0.2, armature=0.1)
        return replace(random_body(name, kind, parent, rng), joint=joint)

    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return Mechanism([
        body("rail", "prismatic", WORLD, x), body("a", "revolute", "rail", y), body("b", "revolute", "a", (0, -1.0, 0)),
        body("c", "prismatic", "b", z), body("d", "revolute", "c", y), body("out", "revolute", "b", z),
        body("slide", "prismatic", "out", x), body("last", "revolute", "slide", y),
        body("along", "prismatic", "last", y),
    ], (1.0, 2.0, -9.0))  # fmt: skip


MODELS: dict[str, Callable[[], Mechanism]] = {name: lambda make=make: make(6) for name, make in FAMILIES.items()} | {
    "slides first": lambda: random_mechanism(7, ["prismatic", "prismatic", "revolute"], 2),
    "quarter turns": lambda: turned_arm(5),
    "tree": lambda: turned_tree(7),
    "plane and out": in_a_plane_and_out,
    "no gravity": lambda: replace(FAMILIES["mixed"](5), gravity=(0.0, 0.0, 0.0)),
    "regrouped": lambda: replace(FAMILIES["branched"](6), base_parameters=True),
    "planar arm": lambda: dyn.planar_arm([1.0, 0.8, 0.7, 0.9], [1.0, 0.8, 0.7, 0.4], damping=0.1),
    "planar arm of points": lambda: dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], mass_model="point", gravity=-3.0),
    "pendulum": lambda: dyn.planar_arm([1.3], [0.7]),
    "regrouped slides": lambda: replace(in_a_plane_and_out(), base_parameters=True),
}


def by_lagrange(mechanism: Mechanism) -> dyn.System:
    """The same energy, in a system that knows no more."""
    system = mechanism.system
    return dyn.System(lambda q, qd, t: list(system.partial_lagrangians), system.coordinates, damping=system.damping)


def values(graph: Graph, seed: int) -> Array:
    x = np.random.default_rng(seed).normal(size=len(graph.inputs))
    return np.array([float(y) for y in graph.evaluate(dict(zip(graph.input_names, x, strict=True))).values()])


@mark.parametrize("name", [*[name for name in MODELS if name not in PLAIN], *slow(*PLAIN)])
def test_the_bias_is_that_of_lagrange_s_equation(name: str) -> None:
    mechanism = MODELS[name]()
    found, derived = dyn.bias(mechanism), dyn.bias(by_lagrange(mechanism))
    for seed in range(3):
        expected = values(derived, seed)
        assert values(found, seed) == approx(expected, abs=AGREEMENT * np.abs(expected).max())


@mark.parametrize(
    ("name", "method"),
    [(name, "recursive") for name in MODELS if name not in PLAIN]
    + [
        *slow(*[(name, "recursive") for name in PLAIN]),
        ("mixed", "dense"),
        ("welded", "dense"),
        *slow(*[(name, "dense") for name in MODELS if name not in ("mixed", "welded")]),
    ],
)
def test_accelerations_are_those_of_lagrange_s_equation(name: str, method: str) -> None:
    mechanism = MODELS[name]()
    found, derived = (dyn.forward_dynamics(each, method) for each in (mechanism, by_lagrange(mechanism)))
    for seed in range(3):
        expected = values(derived, seed)
        assert values(found, seed) == approx(expected, abs=AGREEMENT * np.abs(expected).max())


@mark.parametrize("name", ["quarter turns", "tree", "serial", "branched", "planar arm"])
def test_it_takes_fewer_nodes(name: str) -> None:
    mechanism = MODELS[name]()
    found, derived = (len(dyn.bias(each).nodes) for each in (mechanism, by_lagrange(mechanism)))
    assert found < 0.9 * derived


def test_forces_that_come_of_gravity_are_tagged() -> None:
    def tags(mechanism: Mechanism) -> set[str]:
        return {tag for node in dyn.bias(mechanism).nodes for tag in node.tags}

    mechanism = turned_arm(3)
    assert {"kinetic", "potential", "link 1", "link 3"} <= tags(mechanism)
    assert "potential" not in tags(replace(mechanism, gravity=(0.0, 0.0, 0.0)))
