"""The linearization in (q, p): Hamilton's equations differentiated, and what their structure says of it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import Array
from cgraph.extend import Builder
from dynamics import as_system
from dynamics.equations.linearization.linearization_parts import momentum_parts
from dynamics.equations.momentum.hamiltonian import velocities
from tests import high_precision
from tests.slow import slow

from ..linkages import four_bar
from ..mechanisms import random_joint, random_mechanism, turned_arm
from ..models import cart_pendulum, coupled_springs, driven_pendulum, magnetic, random_arm, relativistic
from .test_hamiltonian import point, random_tree, rotor, values
from .test_inverse_dynamics_derivatives import KINDS
from .test_linearization import bead

EQUAL = 1e-12  # of the largest entry
RARE = ("along one axis", "pulled")
SMALL = {
    "planar": lambda: random_arm(3),
    "undamped": lambda: random_arm(2, damped=False),
    "arm": lambda: turned_arm(3),
    "branches": lambda: random_mechanism(3, ["revolute"], 3, 2),
    "springs": coupled_springs,
    "cart": cart_pendulum,
    "driven": driven_pendulum,
    "magnetic": magnetic,
    "relativistic": relativistic,
    "rotor": rotor,
    "ball": lambda: random_mechanism(2, ["ball", "prismatic"], 1),
    "free": lambda: free_base(),
    **{name: KINDS[name] for name in ("screws", "with base parameters", *RARE)},
    "with parameters": lambda: with_mass("m"),
}


def free_base() -> dyn.Mechanism:
    """Two free bodies, one in axes of its own, on one another: brackets of all kinds."""
    rng = np.random.default_rng(0)
    numbers: dict[str, Any] = {"mass": 1.3, "center": (0.1, 0.0, 0.2), "inertia": (0.2, 0.3, 0.4)}
    others = {"stiffness": 0.0, "armature": 0.0, "damping": 0.0}
    joints = [random_joint(kind, rng, **others) for kind in ("free", "free (body axes)")]
    return dyn.Mechanism([dyn.Body("a", joints[0], **numbers), dyn.Body("b", joints[1], "a", **numbers)])


def with_mass(mass: Any) -> dyn.Mechanism:
    """Two hinges, of which the second carries a parameter."""
    first, second = random_mechanism(2, ["revolute"], 1).bodies
    return dyn.Mechanism([first, replace(second, mass=mass)], parameters={mass: 1.7})


def square(graph: cg.Graph, at: dict[str, float], stem: str = "A") -> Array:
    found = values(graph, at, stem)
    rows = len([name for name in graph.outputs if name.startswith(stem) and name.endswith("_0")])
    return found.reshape(rows, -1)


def slopes(model: Any, graph: cg.Graph, at: dict[str, float]) -> Array:
    """The derivative of a graph's outputs by displacements and momenta, column by column in forward mode."""
    system = as_system(model)
    names = [*[f"q{i}" for i in range(system.nq)], *[f"p{i}" for i in range(system.n)]]
    dots = cg.jvp(graph, names)
    moved = cg.Graph([*system.q, *system.qd], {f"{i}": node for i, node in enumerate(system.q_dot)})
    columns = []
    for j in range(2 * system.n):
        unit = np.eye(2 * system.n)[j]
        by_q = values(moved, at | {f"qd{i}": x for i, x in enumerate(unit[: system.n])})
        moves = dict(zip([f"{name}_dot" for name in names], [*by_q, *unit[system.n :]], strict=True))
        columns.append(values(dots, at | moves))
    return np.array(columns).T


def brackets(system: dyn.System, at: dict[str, float]) -> Array:
    """C of the velocities: xi_dot = dqd + C xi."""
    rows = system.kinematics.brackets(Builder())
    c = cg.Graph(system.qd, {f"{i}": x for i, x in enumerate([x for row in rows for x in row])})
    return values(c, at).reshape(system.n, system.n)


def state(model: Any, equations: cg.Graph, moving: cg.Graph, seed: int) -> dict[str, float]:
    """A random state in q and p without applied forces, with the velocities and rates that it has."""
    n = as_system(model).n
    at = point(model, [equations], seed) | {f"tau{i}": 0.0 for i in range(n)}
    at |= {f"p{i}": 0.5 * at[f"p{i}"] for i in range(n)}  # within the range of relativistic momenta
    at |= {f"qd{i}": x for i, x in enumerate(values(moving, at))}
    return at | equations.evaluate({name: at[name] for name in equations.input_names})


def assert_linear(model: Any, seed: int) -> None:
    """A is the derivative of the rates, B that by forces."""
    system, n = as_system(model), as_system(model).n
    graph = dyn.state_space(model, form="momentum")
    equations, moving = dyn.hamilton_equations(model, iterations=12), velocities(system)
    at = state(model, equations, moving, seed)
    found = square(graph, at)
    c = brackets(system, at)
    top = slopes(model, moving, at)
    top[:, :n] += c
    expected = np.vstack([top, slopes(model, equations, at)[system.nq :]])
    assert np.abs(found - expected).max() <= EQUAL * np.abs(expected).max()
    assert np.array_equal(square(graph, at, "B"), np.eye(2 * n)[:, n:])


@pytest.mark.parametrize("name", [*[name for name in SMALL if name not in RARE], *slow(*RARE)])
def test_it_is_the_slope_of_hamilton_s_equations(name: str) -> None:
    assert_linear(SMALL[name](), 2)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_it_is_that_of_random_trees() -> None:
    for seed in range(200):
        assert_linear(random_tree(seed, 4), seed)


def test_of_a_chain_it_keeps_the_digits_whatever_the_condition_of_its_mass_matrix() -> None:
    """S - W^T M^-1 W cancels by ten in this chain: it is off by 1e-13 of its entries, rounding alone by 2e-14."""
    chain, n = dyn.planar_arm([1.0] * 5, [1.0, 1e-3, 1.0, 1e-3, 1.0], gravity=0.0), 5
    graph = momentum_parts(chain.system).written_out()
    q = [0.3, -0.4, 0.9, 1.3, -0.2]
    at = {f"{kind}{i}": x for kind in ("q", "qd") for i, x in enumerate(q)}
    exact = high_precision.evaluate(graph, {name: at.get(name, 0.0) for name in graph.input_names}, digits=40)
    entries = [float(x) for name, x in exact.items() if name.startswith("A")]
    expected = np.reshape(entries, (2 * n, 2 * n))
    assert np.linalg.cond(dyn.arrays_at(chain, dyn.mass_matrix(chain), q)["M"]) > 1e6
    wrong = np.abs(square(graph, at) - expected)
    for rows in (slice(n), slice(n, None)):
        for columns in (slice(n), slice(n, None)):
            assert wrong[rows, columns].max() < 5e-13 * np.abs(expected[rows, columns]).max()


def test_what_has_no_such_linearization_is_said() -> None:
    for function in (dyn.linearize, dyn.linearize_many):
        with pytest.raises(dyn.ConstraintError, match="holds the momenta"):
            function(four_bar(), [[1.0, -0.8, 1.5]], [[5.0, 0.0, 0.0]], form="momentum")
        with pytest.raises(ValueError, match=r"q must have the shape \(2,\)"):
            function(SMALL["undamped"](), [0.0] * 3, [0.0] * 2, form="momentum")
    with pytest.raises(dyn.SingularMassMatrixError, match="inertia that is not positive"):
        dyn.linearize(dyn.System(bead, ["x"]), [0.0], [0.0], form="momentum")
    with pytest.raises(ValueError, match="form must be"):
        dyn.state_space(SMALL["cart"](), form="momenta")
