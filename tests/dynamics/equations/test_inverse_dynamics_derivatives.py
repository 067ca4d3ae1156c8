"""Derivatives of inverse dynamics against differences in 60 digits of its own graph, which AD made from the energy.

Those of trees of plain joints are held to other equations in test_exact_slopes.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

import cgraph as cg
import dynamics as dyn
from dynamics import as_system
from tests import high_precision
from tests.dynamics.mechanisms import TREES, Array, random_mechanism, turned_arm
from tests.dynamics.models import MODELS, random_arm
from tests.dynamics.parametrized import parametrized

DIGITS = 60
STEP = mpf(10) ** -18  # central differences: error about 1e-36
ROUNDING = 4e-15  # of the largest entry

KINDS: dict[str, Callable[[], dyn.Mechanism]] = {
    "screws": lambda: random_mechanism(3, ["screw", "revolute"], 2),
    "compositions": lambda: random_mechanism(3, ["cylindrical", "universal", "planar"], 2),
    "with parameters": lambda: parametrized(random_mechanism(3, ["revolute", "prismatic"], 2), 1),
    "with base parameters": lambda: replace(random_mechanism(4, ["revolute", "prismatic"], 2), base_parameters=True),
    "in a plane": lambda: random_arm(4),
    "along one axis": lambda: along_z(random_mechanism(5, ["revolute", "screw", "prismatic"], 2)),
    "pulled": lambda: replace(random_mechanism(3, ["revolute", "ball"], 1), forces=[wind()]),
}
SYSTEMS: dict[str, Callable[[], Any]] = KINDS | MODELS


def along_z(tree: dyn.Mechanism) -> dyn.Mechanism:
    """The tree with all joints along z, one of them against it."""
    signs = [-1.0 if i == 2 else 1.0 for i in range(len(tree.bodies))]
    turned = [
        replace(body, joint=replace(body.joint, axis=(0.0, 0.0, sign), orientation=np.eye(3)))
        for body, sign in zip(tree.bodies, signs, strict=True)
    ]
    return dyn.Mechanism(turned, tree.gravity)


def wind() -> dyn.Force:
    """On the last body, depending on how the first moves."""
    q, qd = cg.variables("q0 qd0")
    return dyn.Force("b2", [-0.3 * qd * qd, 0.2 * q, cg.sin(q)], at=(0.1, 0.2, 0.3), frame="body")


def point(system: Any, seed: int = 0) -> dict[str, float]:
    """A state near neutral with accelerations, and the parameters."""
    rng = np.random.default_rng(seed)
    numbers = {f"q{i}": start + rng.uniform(-1.0, 1.0) for i, start in enumerate(system.kinematics.neutral)}
    numbers |= {f"{kind}{i}": rng.normal() for kind in ("qd", "qdd") for i in range(system.n)}
    return numbers | {"t": 0.3} | system.parameters


def differences(system: Any, at: dict[str, float]) -> tuple[list[mpf], dict[str, list[list[mpf]]]]:
    """tau, and columns of its slopes by displacements, velocities and accelerations."""
    graph = dyn.inverse_dynamics(system)
    rates = system.graph({f"r{i}": node for i, node in enumerate(system.q_dot)}, system.q, system.qd)
    n = system.n
    with mp.workdps(DIGITS):
        x = {name: mpf(value) for name, value in at.items()}

        def values(of: cg.Graph, where: dict[str, mpf]) -> list[mpf]:
            return list(high_precision.evaluate(of, {name: where[name] for name in of.input_names}, DIGITS).values())

        def slope(direction: dict[str, mpf]) -> list[mpf]:
            ends = [values(graph, x | {k: x[k] + sign * STEP * d for k, d in direction.items()}) for sign in (1, -1)]
            return [(a - b) / (2 * STEP) for a, b in zip(*ends, strict=True)]

        columns: dict[str, list[list[mpf]]] = {"dtau_dq": [], "dtau_dqd": [], "M": []}
        for j in range(n):
            unit = {f"qd{i}": mpf(i == j) for i in range(n)}
            displaced = values(rates, x | unit)
            columns["dtau_dq"].append(slope({f"q{i}": rate for i, rate in enumerate(displaced)}))
            columns["dtau_dqd"].append(slope({f"qd{j}": mpf(1)}))
            columns["M"].append(slope({f"qdd{j}": mpf(1)}))
        return values(graph, x), columns


@pytest.mark.parametrize("name", SYSTEMS)
def test_they_are_the_slopes_of_inverse_dynamics(name: str) -> None:
    model = SYSTEMS[name]()
    system = as_system(model)
    at, graph = point(system), dyn.inverse_dynamics_derivatives(model)
    found = graph.evaluate({key: at[key] for key in graph.input_names})
    torques, columns = differences(system, at)
    scale = max(abs(float(tau)) for tau in torques)
    for i, tau in enumerate(torques):
        assert abs(found[f"tau{i}"] - float(tau)) <= ROUNDING * scale
    for name, rows in columns.items():
        scale = max(abs(float(entry)) for row in rows for entry in row)
        for j, column in enumerate(rows):
            for i, entry in enumerate(column):
                assert abs(found[f"{name}_{i}_{j}"] - float(entry)) <= ROUNDING * max(scale, 1e-3), (name, i, j)


@pytest.mark.parametrize("name", ["hinges", "a ball on a slide", "a free base", "in a plane"])
def test_the_closed_form_is_smaller_than_differentiation(name: str) -> None:
    model = (TREES | KINDS)[name]()
    system = as_system(model)
    tau = cg.simplify(dyn.inverse_dynamics(model, "chain_rule"))
    derived = cg.jacobian(tau, [node.name for node in (*system.q, *system.qd, *system.qdd)])
    assert len(dyn.inverse_dynamics_derivatives(model).nodes) < len(derived.nodes) + len(tau.nodes)


def test_bodies_on_different_branches_have_nothing_to_do_with_one_another() -> None:
    tree = random_mechanism(7, ["revolute"], 4)
    parents = tree.parents
    graph = dyn.inverse_dynamics_derivatives(tree)

    def path(i: int) -> set[int]:
        return {i} | (path(parents[i]) if parents[i] >= 0 else set())

    apart = 0
    for name in ("dtau_dq", "dtau_dqd", "M"):
        for i in range(7):
            for j in range(7):
                zero = graph.outputs[f"{name}_{i}_{j}"].value == 0.0
                branches = j not in path(i) and i not in path(j)
                apart += branches
                assert zero or not branches
    assert apart


def test_the_mass_matrix_is_symmetric_to_the_last_bit() -> None:
    graph = dyn.inverse_dynamics_derivatives(random_mechanism(4, ["revolute", "ball"], 2))
    count = as_system(random_mechanism(4, ["revolute", "ball"], 2)).n
    for i in range(count):
        for j in range(i):
            assert graph.outputs[f"M_{i}_{j}"] is graph.outputs[f"M_{j}_{i}"]


def test_the_last_body_of_a_long_chain_keeps_its_digits() -> None:
    """Numbers of the tip are taken about the tip: about the base they would be differences of some 1e4 times them."""
    arm = dyn.planar_arm([1.0] * 12, [10.0] * 11 + [0.1])
    rng = np.random.default_rng(0)
    graph = dyn.inverse_dynamics_derivatives(arm)
    at = dict(zip(graph.input_names, rng.uniform(-0.1, 0.1, len(graph.inputs)).tolist(), strict=True))
    found = graph.evaluate(at)
    exact = high_precision.evaluate(graph, at, DIGITS)
    for name in ("dtau_dq_11_11", "dtau_dqd_11_0", "M_11_11"):
        assert found[name] == pytest.approx(float(exact[name]), rel=1e-14)


def test_the_inverse_of_the_mass_matrix() -> None:
    for model in (random_mechanism(4, ["revolute", "ball"], 2), random_arm(3), MODELS["magnetic"](), turned_arm(8)):
        system = as_system(model)
        q = np.array(system.kinematics.neutral) + np.random.default_rng(0).uniform(-1.0, 1.0, system.nq)
        mass = dyn.arrays_at(model, dyn.mass_matrix(model), q=q)["M"]
        inverse: Array = dyn.arrays_at(model, dyn.inverse_mass_matrix(model), q=q)["Minv"]
        assert np.abs(inverse - inverse.T).max() == 0.0
        assert np.abs(mass @ inverse - np.eye(system.n)).max() < 1e-14 * np.linalg.cond(mass)


def test_straight_chains_are_linearized_to_the_last_digits() -> None:
    """Where a dense factorization of M loses four digits."""
    graph = dyn.state_space(dyn.planar_arm([1.0] * 8, [1.0] * 8))
    rng = np.random.default_rng(0)
    at = dict(zip(graph.input_names, rng.uniform(-0.1, 0.1, len(graph.inputs)).tolist(), strict=True))
    exact = [float(value) for value in high_precision.evaluate(graph, at, DIGITS).values()]
    found = np.array(list(graph.evaluate(at).values()))
    assert np.abs(found - exact).max() < ROUNDING * np.abs(exact).max()


@pytest.mark.parametrize("kind", ["hinges", "a free base", "with parameters"])
def test_compiled_they_are_the_arrays_of_many_states(kind: str) -> None:
    mechanism = (TREES | KINDS)[kind]()
    system, rng = mechanism.system, np.random.default_rng(0)
    graph, compiled = (
        dyn.inverse_dynamics_derivatives(mechanism),
        cg.compile(dyn.inverse_dynamics_derivatives(mechanism)),
    )
    q = np.array(system.kinematics.neutral) + rng.uniform(-0.3, 0.3, (11, system.nq))
    qd, qdd = rng.normal(size=(11, system.n)), rng.normal(size=system.n)
    many = dyn.arrays_at(mechanism, compiled, q, qd, qdd)
    one = dyn.arrays_at(mechanism, compiled, q[3], qd[3], qdd)
    expected = dyn.arrays_at(mechanism, graph, q, qd, qdd)
    assert list(many) == list(one) == list(expected)
    for name, array in expected.items():
        assert many[name].shape == array.shape
        for found, wanted in ((many[name], array), (one[name], array[3])):
            assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()
