"""The linearization in (q, p): Hamilton's equations differentiated, and what their structure says of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.extend import Array, Builder, cotangents
from dynamics.equations.linearization import linearize_many as many
from dynamics.equations.linearization.momentum_parts import momentum_parts
from dynamics.equations.momentum.hamiltonian import velocities
from dynamics.systems.model import as_system
from tests.slow import slow

from ..linkages import four_bar
from ..mechanisms import random_joint, random_mechanism, turned_arm
from ..models import cart_pendulum, coupled_springs, driven_pendulum, magnetic, random_arm, relativistic
from .test_hamiltonian import point, random_tree, rotor, values
from .test_inverse_dynamics_derivatives import KINDS

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
    bodies = list(random_mechanism(2, ["revolute"], 1).bodies)
    bodies[1] = replace(bodies[1], mass=mass)
    return dyn.Mechanism(bodies, parameters={mass: 1.7})


def square(graph: cg.Graph, at: dict[str, float], stem: str = "A") -> Array:
    found = values(graph, at, stem)
    rows = len([name for name in graph.outputs if name.startswith(stem) and name.endswith("_0")])
    return found.reshape(rows, -1)


def along(system: dyn.System) -> Array:
    """J of A = J H''."""
    n = system.n
    return np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])


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


def brackets(system: dyn.System, at: dict[str, float]) -> tuple[Array, Array, Array]:
    """C of the velocities, and P of the momenta and of their rates: xi_dot = dqd + C xi, P_kj = p . c(e_j, e_k)."""
    n, p = system.n, cg.variables([f"p{i}" for i in range(system.n)])
    rows = system.kinematics.brackets(Builder())
    terms = system.kinematics.structure(p, Builder())
    twist = [cotangents({term: cg.constant(1.0)}, system.qd) for term in terms]
    c = cg.Graph(system.qd, {f"{i}": x for i, x in enumerate([x for row in rows for x in row])})
    bent = cg.Graph([*system.qd, *p], {f"{i}": x for i, x in enumerate([x for row in twist for x in row])})
    rates = {f"p{i}": at[f"p{i}_dot"] for i in range(n)}
    return tuple([values(graph, each).reshape(n, n) for graph, each in ((c, at), (bent, at), (bent, at | rates))])


def state(model: Any, equations: cg.Graph, moving: cg.Graph, seed: int) -> dict[str, float]:
    """A random state in q and p without applied forces, with the velocities and rates that it has."""
    n = as_system(model).n
    at = point(model, [equations], seed) | {f"tau{i}": 0.0 for i in range(n)}
    at |= {f"p{i}": 0.5 * at[f"p{i}"] for i in range(n)}  # within the range of relativistic momenta
    at |= {f"qd{i}": x for i, x in enumerate(values(moving, at))}
    return at | equations.evaluate({name: at[name] for name in equations.input_names})


def assert_linear(model: Any, seed: int) -> None:
    """A is the derivative of the rates; without damping and forces it has the structure of a Hamiltonian."""
    system, n = as_system(model), as_system(model).n
    graph = dyn.state_space(model, form="momentum")
    equations, moving = dyn.hamilton_equations(model, iterations=12), velocities(system)
    at = state(model, equations, moving, seed)
    found = square(graph, at)
    c, p, p_rate = brackets(system, at)
    top = slopes(model, moving, at)
    top[:, :n] += c
    expected = np.vstack([top, slopes(model, equations, at)[system.nq :]])
    assert np.abs(found - expected).max() <= EQUAL * np.abs(expected).max()
    assert np.array_equal(square(graph, at, "B"), np.eye(2 * n)[:, n:])
    if any(node.value != 0.0 for node in system.forces) or any(
        x.value != 0.0 for x in map(cg.constant, system.damping)
    ):
        return
    if system.kinematics.quasi is None:
        matrix = along(system) @ found
        assert np.array_equal(matrix, matrix.T)
    to, rate = np.eye(2 * n), np.zeros((2 * n, 2 * n))  # of dp + P xi / 2, which are canonical
    to[n:, :n], rate[n:, :n] = 0.5 * p, 0.5 * p_rate
    matrix = along(system) @ (to @ found + rate) @ np.linalg.inv(to)
    assert np.abs(matrix - matrix.T).max() <= EQUAL * np.abs(matrix).max()


@pytest.mark.parametrize("name", [*[name for name in SMALL if name not in RARE], *slow(*RARE)])
def test_it_is_the_slope_of_hamilton_s_equations(name: str) -> None:
    assert_linear(SMALL[name](), 2)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_it_is_that_of_random_trees() -> None:
    for seed in range(200):
        assert_linear(random_tree(seed, 4), seed)


@pytest.mark.parametrize("name", ["planar", "driven", "relativistic", "springs"])
def test_it_is_that_of_velocities_in_other_variables(name: str) -> None:
    """(dq, dp) = T (dq, dqd) along the motion: A of one form is (T A + dT/dt) T^-1 of the other."""
    model, n = SMALL[name](), as_system(SMALL[name]()).n
    momentum, lagrange = dyn.momentum(model), dyn.state_equation(model)
    wrt = [*[f"q{i}" for i in range(n)], *[f"qd{i}" for i in range(n)]]
    change = cg.jacobian(momentum, wrt)
    rated = cg.jvp(change, [*wrt, *["t"] * ("t" in change.input_names)])
    at = point(model, [lagrange, momentum], 5)
    dots = lagrange.evaluate({name: at[name] for name in lagrange.input_names}) | {"t_dot": 1.0}
    to, rate = np.eye(2 * n), np.zeros((2 * n, 2 * n))
    to[n:], rate[n:] = values(change, at).reshape(n, -1), values(rated, at | dots).reshape(n, -1)
    given = {name: [at[f"{name}{i}"] for i in range(n)] for name in ("q", "qd", "tau")}
    a, b = dyn.linearize(model, **given, t=at["t"])
    found, by_tau = dyn.linearize(model, **given, t=at["t"], form="momentum")
    expected = (to @ a + rate) @ np.linalg.inv(to)
    assert np.abs(found - expected).max() <= EQUAL * np.abs(expected).max()
    assert np.abs(to @ b - by_tau).max() <= EQUAL


@pytest.mark.parametrize("name", ["undamped", "cart", "magnetic"])
def test_modes_come_in_pairs_and_at_rest_are_those_of_the_motion(name: str) -> None:
    model, n = SMALL[name](), as_system(SMALL[name]()).n
    q, still = np.zeros(n), np.zeros(n)
    moving = np.poly(dyn.linearize(model, q + 0.4, still + 0.7, form="momentum")[0])
    assert np.abs(moving[1::2]).max() <= EQUAL * np.abs(moving).max()  # even: with every mode its negative
    assert np.abs(moving[2::2]).max() > 0.1
    found, expected = (np.poly(dyn.linearize(model, q, still, form=form)[0]) for form in ("momentum", "velocity"))
    assert np.abs(found - expected).max() <= EQUAL * np.abs(expected).max()


def test_units_and_the_order_of_coordinates_are_no_part_of_it() -> None:
    """In units that are powers of 2 to the last bit: dq = c dq', dp = dp' / c."""

    def other(scale: Array, order: list[int]) -> dyn.System:
        def lagrangian(q: Any, qd: Any, t: Any) -> cg.Node:
            x, v = ([scale[k] * each[order.index(k)] for k in range(3)] for each in (q, qd))
            planar = 0.5 * (v[0] ** 2 + (2.0 + cg.sin(x[0])) * v[1] ** 2) + v[1] * v[2] * cg.cos(x[0] * x[2])
            return planar + 3.0 * v[2] ** 2 - x[0] ** 2 * x[1] + x[2] ** 4

        return dyn.System(lagrangian, [f"x{k}" for k in order])

    q, qd, plain, order = np.array([0.3, -0.4, 1.1]), np.array([0.7, 0.2, -0.5]), np.ones(3), [2, 0, 1]
    expected = dyn.linearize(other(plain, [0, 1, 2]), q, qd, form="momentum")[0]
    scale = np.array([2.0**40, 2.0**-30, 2.0**9])
    found = dyn.linearize(other(scale, [0, 1, 2]), q / scale, qd / scale, form="momentum")[0]
    units = np.concatenate([scale, 1.0 / scale])
    assert np.array_equal(found * units[:, None] / units, expected)
    found = dyn.linearize(other(plain, order), q[order], qd[order], form="momentum")[0]
    places = [*order, *[3 + k for k in order]]
    assert np.abs(found - expected[np.ix_(places, places)]).max() <= EQUAL * np.abs(expected).max()


def test_of_a_chain_it_keeps_the_digits_whatever_the_condition_of_its_mass_matrix() -> None:
    """S - W^T M^-1 W cancels by ten in this chain: it is off by 1e-13 of its entries, rounding alone by 2e-14."""
    chain, n = dyn.planar_arm([1.0] * 5, [1.0, 1e-3, 1.0, 1e-3, 1.0], gravity=0.0), 5
    graph = momentum_parts(chain.system).written_out()
    q = [0.3, -0.4, 0.9, 1.3, -0.2]
    at = {f"{kind}{i}": x for kind in ("q", "qd") for i, x in enumerate(q)}
    exact = cg.double_double(graph)
    expected = square(exact, {name: at.get(name, 0.0) for name in exact.input_names})
    assert np.linalg.cond(dyn.arrays_at(chain, dyn.mass_matrix(chain), q)["M"]) > 1e6
    wrong = np.abs(square(graph, at) - expected)
    for rows in (slice(n), slice(n, None)):
        for columns in (slice(n), slice(n, None)):
            assert wrong[rows, columns].max() < 5e-13 * np.abs(expected[rows, columns]).max()


@pytest.mark.parametrize(("name", "columns"), [("arm", False), ("planar", True), ("rotor", True)])
def test_many_states_are_linearized_as_one(name: str, columns: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Written out, and column by column; and where nothing brakes, J A symmetric to the last bit in machine code."""
    monkeypatch.setattr(many, "WRITTEN_OUT", 0 if columns else many.WRITTEN_OUT)
    monkeypatch.setattr(many, "MATRICES", 3)
    model, rng = SMALL[name](), np.random.default_rng(0)
    system = as_system(model)
    q = np.array(system.kinematics.neutral) + rng.uniform(-1.0, 1.0, (5, system.nq))
    qd = rng.normal(size=(5, system.n))
    a, b = dyn.linearize_many(model, q, qd, t=0.3, form="momentum")
    for k in range(len(q)):
        expected, by_tau = dyn.linearize(model, q[k], qd[k], t=0.3, form="momentum")
        assert np.abs(a[k] - expected).max() < 1e-13 * np.abs(expected).max()
        assert np.array_equal(b[k], by_tau)
        if name == "arm":
            matrix = along(system) @ a[k]
            assert np.array_equal(matrix, matrix.T)


def bead(q: Any, qd: Any, t: Any) -> cg.Node:
    """Without inertia at 0."""
    return 0.5 * q[0] ** 2 * qd[0] ** 2 - q[0]


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
    named = dyn.System(lambda q, qd, t, p: p["p0"] * qd[0] ** 2, ["x"], {"p0": 1.0})
    with pytest.raises(ValueError, match="parameter 'p0' has the name of a momentum"):
        dyn.state_space(named, form="momentum")
