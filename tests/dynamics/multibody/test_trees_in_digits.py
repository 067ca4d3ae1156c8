"""Mass matrix, bias and accelerations of trees of bodies of every joint, beside 66 digits without graphs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dynamics as dyn
from cgraph import Graph
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.sweeps.equation_links import equation_links
from tests.dynamics.mechanisms import Array, random_inertia, random_mechanism, random_state, random_tree
from tests.slow import slow

MASS, RECURSIVE, DENSE = 2e-15, 4e-15, 1e-14  # of the largest entry: some ten roundings, and what M loses


def values(graph: Graph, at: dict[str, Array]) -> Array:
    known = {f"{name}{i}": value for name, row in at.items() for i, value in enumerate(row.tolist())}
    found = graph.evaluate({name: known[name] for name in graph.input_names})
    return np.array([float(value) for value in found.values()])


def errors(tree: dyn.Mechanism, seed: int) -> dict[str, float]:
    """Largest errors, over the largest entries."""
    pytest.importorskip("flint")
    from tests.dynamics.tree_in_digits import tree_in_digits

    q, qd, _, tau = random_state(tree, seed)
    mass, bias, accelerations = tree_in_digits(tree, q, qd, tau)
    rows = {
        "mass": (dyn.mass_matrix(tree), mass.ravel()),
        "bias": (dyn.bias(tree), bias),
        "recursive": (dyn.forward_dynamics(tree, "recursive"), accelerations),
        "auto": (dyn.forward_dynamics(tree), accelerations),
    }
    found = {name: (values(graph, {"q": q, "qd": qd, "tau": tau}), exact) for name, (graph, exact) in rows.items()}
    return {name: float(np.abs(x - exact).max() / np.abs(exact).max()) for name, (x, exact) in found.items()}


def chain(n: int, angle: float, scale: float = 1.0) -> dyn.Mechanism:
    """Hinges, each turned from the last by an angle about a horizontal axis."""
    rng = np.random.default_rng(5)
    turn = rotation(np.array([1.0, 0.3, 0.0]) / np.hypot(1.0, 0.3), angle)
    links = [
        {
            "joint": dyn.Joint("revolute", (0.0, 0.0, 1.0), scale * 0.3 * rng.normal(size=3), turn),
            "mass": 1.0,
            "center": 0.1 * rng.normal(size=3),
            "inertia": random_inertia(rng),
        }
        for _ in range(n)
    ]
    return dyn.serial_arm(links, (1.0, 0.0, -9.81))


def heavier(tree: dyn.Mechanism, decades: float) -> dyn.Mechanism:
    """Masses that grow to the tip."""
    factors = (10.0 ** np.linspace(0.0, decades, len(tree.bodies))).tolist()
    grown = [
        replace(body, mass=float(body.mass) * factor, inertia=np.asarray(body.inertia) * factor)
        for body, factor in zip(tree.bodies, factors, strict=True)
    ]
    return replace(tree, bodies=grown)


@pytest.mark.parametrize("seed", [*range(12), *slow(*range(12, 60))])
def test_trees_of_every_joint(seed: int) -> None:
    kinds = ["revolute", "screw", "prismatic"]
    tree = random_tree(seed, 1 + seed % 7) if seed % 2 else random_mechanism(2 + seed % 5, kinds, 3, seed)
    found = errors(tree, seed)
    assert found["mass"] < MASS
    assert found["recursive"] < RECURSIVE
    assert max(found["bias"], found["auto"]) < DENSE  # of a bias whose terms cancel at some states


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-8, 1e-12])
def test_axes_that_are_nearly_parallel_lose_nothing(angle: float) -> None:
    found = errors(chain(6, angle), 1)
    assert found["mass"] < MASS
    assert max(found["bias"], found["recursive"], found["auto"]) < RECURSIVE


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_long_and_short_links(scale: float) -> None:
    found = errors(chain(6, 1.0, scale), 1)
    assert found["mass"] < MASS
    assert max(found["bias"], found["recursive"]) < RECURSIVE
    assert (
        found["auto"] < 10.0 * DENSE
    )  # dense: over states no worse than three times elimination, at this one ten times


def test_with_a_heavy_tip_the_accelerations_are_those_of_elimination() -> None:
    tree = heavier(chain(6, 1.0), 6.0)
    auto, recursive, dense = (dyn.forward_dynamics(tree, method) for method in ("auto", "recursive", "dense"))
    assert len(dense.nodes) < 0.9 * len(recursive.nodes) == 0.9 * len(auto.nodes)
    light = dyn.forward_dynamics(chain(6, 1.0))
    assert len(light.nodes) < len(recursive.nodes)


def test_links_of_hinges_are_placed_by_two_numbers_and_turned_about_one_axis() -> None:
    arm = chain(5, 1.0)
    placed = equation_links(arm.links, [body.joint.type for body in arm.moving], range(-1, 4))
    for link in placed[1:]:
        assert 0.0 in [x.value for x in link.place]
        assert 0.0 in (link.turn[0][2], link.turn[1][2])
        assert np.asarray(link.turn) @ np.asarray(link.turn).T == pytest.approx(np.eye(3), abs=1e-15)
