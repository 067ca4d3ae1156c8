"""Results scale with the units of mass, length and time: no threshold has a size."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pytest import approx, mark, param

import cgraph as cg
import dynamics as dyn
from dynamics.equations.mass_matrix.singular_mass_matrix import balanced
from dynamics.multibody.algebra.spatial import rotation
from tests.dynamics.mechanisms import Array, random_body
from tests.dynamics.models import run
from tests.dynamics.units import Units, in_units, random_units
from tests.tolerances import LAST_BITS

DECIMAL = 1e-14  # of the largest entry, of accelerations times the condition number of M: all data are rounded
STATES = 5


def random_tree(seed: int, most: int) -> dyn.Mechanism:
    """Hinges, slides, screws and welds, in space or by quarter turns, with springs, armature, links without mass."""
    rng = np.random.default_rng(seed)
    bodies: list[dyn.Body] = []
    for i in range(int(rng.integers(2, most + 1))):
        kind = str(
            rng.choice(["revolute", "revolute", "prismatic", "screw", "fixed"] if i else ["revolute", "prismatic"])
        )
        parent = bodies[int(rng.integers(max(0, i - 2), i))].name if i else "world"
        others: dict[str, Any] = {} if rng.random() < 0.3 else {"armature": 0.0, "stiffness": 0.0}
        if seed % 2:  # axes along or across, and places beside
            turn = rotation(np.eye(3)[int(rng.integers(3))], 0.5 * math.pi * int(rng.integers(4)))
            place = np.where(rng.random(3) < 0.5, 0.0, rng.normal(size=3))
            others |= {"axis": np.eye(3)[int(rng.integers(3))], "orientation": turn, "position": place}
        body = random_body(f"b{i}", kind, parent, rng)
        bodies.append(replace(body, joint=replace(body.joint, **({} if kind == "fixed" else others))))
    carrying = {body.parent for body in bodies if body.joint.type.moves}
    for i, body in enumerate(bodies):
        if body.name in carrying and rng.random() < 0.4:
            rotor = {"armature": 0.3} if seed % 2 and body.joint.type.moves else {}  # joints along one line
            bodies[i] = replace(body, mass=0.0, inertia=np.zeros(3), joint=replace(body.joint, **rotor))
    return dyn.Mechanism(bodies, (5.0 * rng.normal(size=3), (0.0, 0.0, -9.81))[seed % 2])


Factor = Callable[[Units, Array], Any]
QUANTITIES: dict[str, tuple[Callable[[Any], cg.Graph], Factor]] = {
    "mass matrix": (dyn.mass_matrix, lambda s, u: (s.energy * s.time * s.time / np.outer(u, u)).ravel()),
    "bias": (dyn.bias, lambda s, u: s.energy / u),
    "inverse dynamics": (dyn.inverse_dynamics, lambda s, u: s.energy / u),
    "forward dynamics": (dyn.forward_dynamics, lambda s, u: u / s.time / s.time),
    "energy": (dyn.energy, lambda s, u: s.energy),
    "momentum in space": (
        dyn.spatial_momentum,
        lambda s, u: s.energy * s.time / s.length * s.length ** (np.arange(6) // 3),
    ),
}


def results(mechanism: dyn.Mechanism, units: Units) -> dict[str, Array]:
    """The quantities at random states, (STATES, ...), evaluated in those units and brought back."""
    u, t = units.of(mechanism), units.time
    rng = np.random.default_rng(0)
    rates = {"q": u, "qd": u / t, "qdd": u / t / t, "tau": units.energy / u}
    at = {name: rng.uniform(-2.0, 2.0, (STATES, len(u))) * factor for name, factor in rates.items()}
    model = in_units(mechanism, units)
    return {name: run(graph(model), at) / factor(units, u) for name, (graph, factor) in QUANTITIES.items()}


@mark.parametrize("seeds", [[*range(8), 29], param(range(8, 200), marks=mark.slow)], ids=["9 trees", "192 trees"])
def test_in_units_of_powers_of_two_every_bit_is_the_same(seeds: Sequence[int]) -> None:
    """With samples of size 1 whatever the unit, another graph of accelerations is chosen of tree 29."""
    for seed in seeds:
        mechanism = random_tree(seed, 3 if seed < 20 else 6)
        factors = [random_units(np.random.default_rng(seed), binary=True)]
        factors += [Units(length=2.0**sign) for sign in (-20.0, 20.0)] * (seed == 29)
        for units in factors:
            found = results(mechanism, units)
            for name, expected in results(mechanism, Units()).items():
                assert found[name].tolist() == expected.tolist(), (seed, name, units)


def worst(seed: int, most: int) -> float:
    """The largest change of a result in other units, relative: of accelerations, to what rounding the data may do."""
    mechanism = random_tree(seed, most)
    n = len(mechanism.moving)
    found = results(mechanism, random_units(np.random.default_rng(seed), binary=False))
    plain = results(mechanism, Units())
    sizes = {name: np.abs(values).max() or 1.0 for name, values in plain.items()}
    sizes["forward dynamics"] *= np.linalg.cond(balanced(plain["mass matrix"].reshape(-1, n, n))).max()
    return max([float(np.abs(found[name] - plain[name]).max() / size) for name, size in sizes.items()])


@mark.parametrize("seeds", [range(4), param(range(4, 200), marks=mark.slow)], ids=["4 trees", "196 trees"])
def test_in_any_units_results_are_the_same_to_rounding(seeds: range, record_property) -> None:
    found = max([worst(seed, 3 if len(seeds) < 10 else 6) for seed in seeds])
    record_property("worst", found)
    print(f"{len(seeds)} trees: worst {found:.1e}")  # noqa: T201
    assert found < DECIMAL


def pendulum(center: ArrayLike, gravity: ArrayLike, axis: ArrayLike = (0.0, 0.0, 1.0), **others: Any) -> dyn.Mechanism:
    """1 kg on a hinge."""
    return dyn.Mechanism([dyn.Body("mass", dyn.Joint("revolute", axis), mass=1.0, center=center, **others)], gravity)


REST = {"q0": 0.0, "qd0": 0.0}


@mark.parametrize("small", [1e-6, 1e-9, 1e-15, 1e-30, 1e-150])
def test_a_number_that_is_small_beside_others_of_its_vector_counts(small: float) -> None:
    """A mass that is hardly beside the axis, gravity hardly across it, a thin rod on its axis, a short vector."""
    far = pendulum((small, 0.0, 1.0), (0.0, -1.0, 0.0))
    assert dyn.mass_matrix(far).evaluate(REST) == approx({"M_0_0": small * small}, rel=LAST_BITS, abs=0.0)
    assert dyn.gravity_force(far).evaluate(REST) == {"gravity0": small}
    steep = pendulum((1.0, 0.0, 0.0), (0.0, -small, -1.0))
    assert dyn.gravity_force(steep).evaluate(REST) == {"gravity0": small}
    thin = pendulum((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), inertia=(1.0, 1.0, small))
    assert dyn.mass_matrix(thin).evaluate(REST) == {"M_0_0": small}
    short = pendulum((1.0, 0.0, 0.0), (0.0, -(small**2), 0.0), (0.0, 0.0, small**2))
    assert dyn.gravity_force(short).evaluate(REST) == {"gravity0": small**2}


@mark.parametrize("tilt", [1e-5, 1e-7, 1e-9, 1e-11, 1e-13])
def test_hinges_that_are_nearly_parallel_are_not_taken_as_parallel(tilt: float) -> None:
    """Two axes through one point: M_01 = z_0 . J z_1."""
    inertia = np.array([[0.3, 0.0, 0.05], [0.0, 0.2, 0.06], [0.05, 0.06, 1e-5]]) + np.diag([0.0, 0.0, 0.2])
    turn = rotation(np.array([1.0, 0.0, 0.0]), tilt)
    bodies = [dyn.Body("first", dyn.Joint("revolute"), inertia=(1.0, 1.0, 1.0)),
              dyn.Body("second", dyn.Joint("revolute", orientation=turn), "first", inertia=inertia)]  # fmt: skip
    angle = 0.4
    matrix = dyn.mass_matrix(dyn.Mechanism(bodies)).evaluate({"q0": 0.1, "qd0": 0.0, "q1": angle, "qd1": 0.0})
    first_axis = math.sin(tilt) * math.sin(angle), math.sin(tilt) * math.cos(angle), math.cos(tilt)
    assert matrix["M_0_1"] == approx(np.dot(first_axis, inertia[2]), rel=LAST_BITS)
