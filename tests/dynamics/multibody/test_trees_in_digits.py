"""Mass matrix, bias and accelerations of trees of bodies of every joint, beside 66 digits without graphs."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import dynamics as dyn
from dynamics.multibody.algebra.spatial import rotation
from dynamics.multibody.sweeps.equation_links import equation_links
from tests.dynamics.mechanisms import (
    EVERY_KIND,
    FAMILIES,
    random_body,
    random_inertia,
    random_mechanism,
    random_state,
    random_tree,
    turned_arm,
    turned_tree,
)
from tests.dynamics.models import run as values
from tests.dynamics.multibody.test_units import random_tree as units_tree
from tests.dynamics.tree_in_digits import tree_in_digits
from tests.each_row import each_row
from tests.slow import slow

# Of the sums of sizes that an answer comes from: what some ten to thirty roundings leave.
OF_SIZES = {"mass": 2e-15, "bias": 4e-15, "torques": 4e-15, "by velocities": 4e-15, "chain rule": 1e-14}
OF_SIZES |= {
    "by rows": 4e-15,
    "forward by rows": 4e-15,
    "regrouped": 1e-13,
    "recursive": 3e-15,
    "dense": 6e-15,
    "auto": 6e-15,
}
MASS, RECURSIVE, DENSE = 2e-15, 4e-15, 1e-14  # of the largest entry, which may be what is left of larger ones
CANCELLED = 3e-14  # of the largest entry, over hundreds of trees


def errors(tree: dyn.Mechanism, seed: int, *of_all: str) -> tuple[dict[str, float], dict[str, float]]:
    """Largest errors, over the largest of the sums of sizes that they come from, and over the largest entry.

    of_all: some of the names of `OF_SIZES`, if not all of them.
    """
    q, qd, qdd, tau = random_state(tree, seed)
    exact, weight = tree_in_digits(tree, q, qd, qdd, tau), tree_in_digits(tree, q, 0.0 * qd, qdd, tau)["bias"]
    bias = np.abs(weight) + np.abs(exact["bias"] - weight) + np.abs(np.array(tree.system.damping) * qd)
    sizes = {
        "mass": np.abs(exact["mass"]),
        "bias": bias,
        "torques": np.abs(exact["mass"]) @ np.abs(qdd) + bias,
        "accelerations": np.abs(np.linalg.inv(exact["mass"])) @ (np.abs(tau) + bias),
    }
    at = {"q": q, "qd": qd, "qdd": qdd, "tau": tau}
    rows = {
        "mass": (lambda: values(dyn.mass_matrix(tree), at), "mass"),
        "bias": (lambda: values(dyn.bias(tree), at), "bias"),
        "torques": (lambda: values(dyn.inverse_dynamics(tree), at), "torques"),
        "by velocities": (lambda: values(dyn.inverse_dynamics(tree, "newton_euler"), at), "torques"),
        "chain rule": (lambda: values(dyn.inverse_dynamics(tree, "chain_rule"), at), "torques"),
        "recursive": (lambda: values(dyn.forward_dynamics(tree, "recursive"), at), "accelerations"),
        "dense": (lambda: values(dyn.forward_dynamics(tree, "dense"), at), "accelerations"),
        "auto": (lambda: values(dyn.forward_dynamics(tree), at), "accelerations"),
        "by rows": (lambda: dyn.Rows(tree).inverse(q, qd, qdd), "torques"),
        "forward by rows": (lambda: dyn.Rows(tree).forward(q, qd, tau), "accelerations"),
        "regrouped": (lambda: values(dyn.inverse_dynamics(replace(tree, base_parameters=True)), at), "torques"),
    }
    found = {name: (row(), of) for name, (row, of) in rows.items() if not of_all or name in of_all}
    off = {name: np.abs(row - exact[of].ravel()).max() for name, (row, of) in found.items()}
    over = [{name: float(off[name] / np.abs(by[of]).max()) for name, (_, of) in found.items()} for by in (sizes, exact)]
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


def in_a_plane_and_out() -> dyn.Mechanism:
    """Slides and hinges in one plane, then bodies that leave it, on both sides of a parallel axis the other way."""
    rng = np.random.default_rng(5)

    def body(name: str, kind: str, parent: str, axis: tuple[float, float, float]) -> dyn.Body:
        joint = dyn.Joint(kind, axis, 0.3 * rng.normal(size=3), stiffness=0.7, spring_reference=0.2, armature=0.1)
        return replace(random_body(name, kind, parent, rng), joint=joint)

    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    return dyn.Mechanism([
        body("rail", "prismatic", "world", x), body("a", "revolute", "rail", y),
        body("b", "revolute", "a", (0, -1.0, 0)), body("c", "prismatic", "b", z), body("d", "revolute", "c", y),
        body("out", "revolute", "b", z), body("slide", "prismatic", "out", x), body("last", "revolute", "slide", y),
        body("along", "prismatic", "last", y),
    ], (1.0, 2.0, -9.0))  # fmt: skip


SPECIAL: dict[str, Callable[[], dyn.Mechanism]] = {
    "slides first": lambda: random_mechanism(7, ["prismatic", "prismatic", "revolute"], 2),
    "welded": lambda: FAMILIES["welded"](6),
    "quarter turns": lambda: turned_arm(5),
    "tree": lambda: turned_tree(7),
    "plane and out": in_a_plane_and_out,
    "no gravity": lambda: replace(FAMILIES["mixed"](5), gravity=(0.0, 0.0, 0.0)),
    "links without mass": lambda: units_tree(6, 5),
    "rotors in a line": lambda: units_tree(9, 5),
    "planar arm": lambda: dyn.planar_arm([1.0, 0.8, 0.7, 0.9], [1.0, 0.8, 0.7, 0.4], damping=0.1),
    "planar arm of points": lambda: dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7], mass_model="point", gravity=-3.0),
}


@each_row("name", SPECIAL)
def test_trees_whose_structure_is_used(name: str) -> None:
    of_sizes, _ = errors(SPECIAL[name](), 2)
    assert {each: x for each, x in of_sizes.items() if x >= 3.0 * OF_SIZES[each]} == {}


# Errors of elimination grow slowly, some eps n; the dense factorisation of M loses what cond(M), about n^4, takes.
CHAINS = {10: 1e-14, 100: 1e-12, 300: 1e-12}
KINDS: dict[str, Callable[[int], dyn.Mechanism]] = {
    "planar": lambda n: dyn.planar_arm(
        [0.2 + 0.05 * (i % 3) for i in range(n)], [0.2 + 0.1 * (i % 2) for i in range(n)], damping=0.1
    ),
    "3D": turned_arm,
}


def off(kind: str, n: int, spread: float, method: str = "recursive") -> float:
    """The largest error of an acceleration at joint angles within +-spread, relative to the largest of them."""
    model, rng = KINDS[kind](n), np.random.default_rng(n)
    at = {"q": rng.uniform(-spread, spread, n), "qd": rng.normal(size=n), "tau": rng.normal(size=n)}
    exact = tree_in_digits(model, at["q"], at["qd"], 0.0 * at["q"], at["tau"])["accelerations"]
    found = values(dyn.forward_dynamics(model, method), at)
    return float(np.abs(found - exact).max() / np.abs(exact).max())


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("n", [10, *slow(100, 300)])
@each_row("kind, spread", [(kind, spread) for kind in KINDS for spread in (0.1, math.pi)])
def test_chains_lose_nothing_to_the_condition_of_their_mass_matrix(kind: str, spread: float, n: int) -> None:
    assert off(kind, n, spread) < CHAINS[n]


def test_a_dense_solve_is_seen_to_be_less_accurate() -> None:
    """Test the test: an error of 1e-12 does not pass for none."""
    assert off("planar", 15, 0.1, "dense") > 10 * CHAINS[10] > 10 * off("planar", 15, 0.1)


def test_what_bodies_state_takes_fewer_nodes_than_their_lagrangian_and_says_what_gravity_does() -> None:
    for model in (turned_arm(5), turned_tree(7), SPECIAL["planar arm"]()):
        system = model.system
        derived = dyn.System(lambda q, qd, t, system=system: list(system.partial_lagrangians), system.coordinates)
        assert len(dyn.bias(model).nodes) < 0.9 * len(dyn.bias(derived).nodes)
        tags = {tag for node in dyn.bias(model).nodes for tag in node.tags}
        assert {"kinetic", "potential"} < tags
        still = replace(model, gravity=(0.0, 0.0, 0.0))
        assert "potential" not in {tag for node in dyn.bias(still).nodes for tag in node.tags}


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


def test_links_of_hinges_are_placed_by_two_numbers_and_turned_about_one_axis() -> None:
    arm = chain(5, 1.0)
    placed = equation_links(arm.links, [body.joint.type for body in arm.moving], range(-1, 4))
    for link in placed[1:]:
        assert 0.0 in [x.value for x in link.place]
        assert 0.0 in (link.turn[0][2], link.turn[1][2])
        assert np.asarray(link.turn) @ np.asarray(link.turn).T == pytest.approx(np.eye(3), abs=1e-15)
