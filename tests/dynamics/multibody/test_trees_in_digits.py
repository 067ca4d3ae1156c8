"""Mass matrix, bias and accelerations of trees of bodies of every joint, beside 66 digits without graphs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dynamics as dyn
from cgraph import Graph
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.sweeps.equation_links import equation_links
from tests.dynamics.mechanisms import EVERY_KIND, Array, random_inertia, random_mechanism, random_state, random_tree
from tests.slow import slow

# Of the sums of sizes that an answer comes from: what some ten to thirty roundings leave.
OF_SIZES = {"mass": 2e-15, "bias": 4e-15, "torques": 4e-15, "chain rule": 1e-14}
OF_SIZES |= {"recursive": 3e-15, "dense": 6e-15, "auto": 6e-15}
MASS, RECURSIVE, DENSE = 2e-15, 4e-15, 1e-14  # of the largest entry, which may be what is left of larger ones
CANCELLED = 3e-14  # of the largest entry, over hundreds of trees


def values(graph: Graph, at: dict[str, Array]) -> Array:
    known = {f"{name}{i}": value for name, row in at.items() for i, value in enumerate(row.tolist())}
    found = graph.evaluate({name: known[name] for name in graph.input_names})
    return np.array([float(value) for value in found.values()])


def errors(tree: dyn.Mechanism, seed: int) -> tuple[dict[str, float], dict[str, float]]:
    """Largest errors, over the largest of the sums of sizes that they come from, and over the largest entry."""
    pytest.importorskip("flint")
    from tests.dynamics.tree_in_digits import tree_in_digits

    q, qd, qdd, tau = random_state(tree, seed)
    exact, weight = tree_in_digits(tree, q, qd, qdd, tau), tree_in_digits(tree, q, 0.0 * qd, qdd, tau)["bias"]
    bias = np.abs(weight) + np.abs(exact["bias"] - weight) + np.abs(np.array(tree.system.damping) * qd)
    sizes = {
        "mass": np.abs(exact["mass"]),
        "bias": bias,
        "torques": np.abs(exact["mass"]) @ np.abs(qdd) + bias,
        "accelerations": np.abs(np.linalg.inv(exact["mass"])) @ (np.abs(tau) + bias),
    }
    rows = {
        "mass": (dyn.mass_matrix(tree), "mass"),
        "bias": (dyn.bias(tree), "bias"),
        "torques": (dyn.inverse_dynamics(tree), "torques"),
        "chain rule": (dyn.inverse_dynamics(tree, "chain_rule"), "torques"),
        "recursive": (dyn.forward_dynamics(tree, "recursive"), "accelerations"),
        "dense": (dyn.forward_dynamics(tree, "dense"), "accelerations"),
        "auto": (dyn.forward_dynamics(tree), "accelerations"),
    }
    at = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    off = {name: np.abs(values(graph, at) - exact[of].ravel()).max() for name, (graph, of) in rows.items()}
    over = [{name: float(off[name] / np.abs(by[of]).max()) for name, (_, of) in rows.items()} for by in (sizes, exact)]
    return over[0], over[1]


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
def test_trees_of_every_joint_beside_their_largest_entry(seed: int) -> None:
    kinds = ["revolute", "screw", "prismatic"]
    tree = random_tree(seed, 1 + seed % 7) if seed % 2 else random_mechanism(2 + seed % 5, kinds, 3, seed)
    _, found = errors(tree, seed)
    assert found["mass"] < MASS
    assert found["recursive"] < RECURSIVE
    assert max(found["bias"], found["auto"]) < DENSE  # of a bias whose terms cancel at some states


@pytest.mark.parametrize("count", [8, pytest.param(200, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])])
def test_trees_of_every_joint(count: int) -> None:
    worst: dict[str, float] = dict.fromkeys(OF_SIZES, 0.0)
    entries = dict(worst)
    for seed in range(count):
        of_sizes, of_entries = errors(random_tree(seed, 1 + seed % 7, EVERY_KIND), seed)
        worst = {name: max(x, of_sizes[name]) for name, x in worst.items()}
        entries = {name: max(x, of_entries[name]) for name, x in entries.items()}
    print(f"{count} trees: {named(worst)}; of the largest entry: {named(entries)}")  # noqa: T201
    assert all(worst[name] < most for name, most in OF_SIZES.items()), worst
    assert max(entries.values()) < CANCELLED


def named(figures: dict[str, float]) -> str:
    return ", ".join([f"{name} {x:.1e}" for name, x in figures.items()])


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-8, 1e-12])
def test_axes_that_are_nearly_parallel_lose_nothing(angle: float) -> None:
    _, found = errors(chain(6, angle), 1)
    print(f"axes {angle:g} rad apart: {named(found)}")  # noqa: T201
    assert found["mass"] < MASS
    assert max(found["bias"], found["torques"], found["recursive"], found["auto"]) < RECURSIVE


@pytest.mark.parametrize("scale", [1e-6, *slow(1e-4, 1e-2, 1e2, 1e4), 1e6])
def test_long_and_short_links(scale: float) -> None:
    of_sizes, found = errors(chain(6, 1.0, scale), 1)
    print(f"offsets of {scale:g} m: {named(of_sizes)}; of the largest entry: {named(found)}")  # noqa: T201
    assert all(of_sizes[name] < most for name, most in OF_SIZES.items()), of_sizes
    assert found["mass"] < MASS
    assert max(found["bias"], found["torques"]) < RECURSIVE
    assert found["recursive"] < (RECURSIVE if scale in (1e-6, 1e6) else DENSE)
    assert found["auto"] < 10.0 * DENSE  # over states no worse than three times elimination, at this one ten times


@pytest.mark.parametrize("n", [6, *slow(12)])
def test_masses_that_grow_by_six_decades_to_the_tip(n: int) -> None:
    tree = heavier(chain(n, 1.0), 6.0)
    of_sizes, found = errors(tree, 1)
    print(f"masses growing to the tip, {n} links: {named(of_sizes)}; of the largest entry: {named(found)}")  # noqa: T201
    assert all(of_sizes[name] < most for name, most in OF_SIZES.items()), of_sizes
    assert found["mass"] < MASS
    assert found["torques"] < RECURSIVE
    assert found["auto"] == found["recursive"] < 10.0 * DENSE  # the dense route loses ten times as much


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
