"""Hamilton's equations: those of Lagrange in (q, p), the slopes of H, and what they say where there are none."""

from functools import cache
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import as_system
from dynamics.systems.model import as_ode

from ..linkages import four_bar
from ..mechanisms import random_body, random_joint
from ..models import MODELS, cart_pendulum, oscillator, relativistic

EQUAL = 1e-13  # of the largest of its kind: some hundred roundings
ENOUGH = 12  # steps to the velocities of these models
KINDS = ["revolute", "ball", "prismatic", "free", "screw", "fixed", "free (body axes)"]


def random_tree(seed: int, most: int = 6) -> dyn.Mechanism:
    rng = np.random.default_rng(seed)
    bodies: list[dyn.Body] = []
    for i in range(int(rng.integers(2, most))):
        kind = str(rng.choice(KINDS)) if i else "revolute"
        lacks = {"free": {"stiffness": 0.0}, "free (body axes)": {"stiffness": 0.0, "armature": 0.0}}.get(kind, {})
        parent = f"b{rng.integers(max(0, i - 3), i)}" if i else "world"
        bodies.append(random_body(f"b{i}", kind, parent, rng, joint=random_joint(kind, rng, **lacks)))
    return dyn.Mechanism(bodies, 5.0 * rng.normal(size=3))


def rotor() -> dyn.System:
    """A lopsided rotor in Euler's velocities, that swings about a point under a force that brakes it."""

    def rate(e: Any, w: Any) -> list[cg.Node]:
        return [
            0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]),
            0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]),
            0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]),
            0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]),
        ]

    def structure(w: Any, p: Any) -> list[cg.Node]:
        return [w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]]

    def lagrangian(e: Any, w: Any, t: Any, p: Any) -> cg.Node:
        up = (e[0] * e[0] - e[1] * e[1] - e[2] * e[2] + e[3] * e[3]) / sum(x * x for x in e)
        return 0.5 * (w[0] ** 2 + 2.0 * w[1] ** 2 + p["J"] * w[2] ** 2) + 0.2 * w[0] * cg.sin(t) * w[2] - 3.0 * up

    turning = dyn.QuasiVelocities("wx wy wz", rate, structure, neutral=[1.0, 0.0, 0.0, 0.0])
    return dyn.System(
        lagrangian, "ew ex ey ez", {"J": 3.0}, lambda q, w, t: [0.1 * w[0] * q[1], 0.0, 1.0], 0.1, turning
    )


SCENES = {name: (lambda name=name: dyn.scenes.load(name)) for name in dyn.scenes.names()}
ALIKE = {"arm of 1", "arm of 2", "arm of 3 points", "arm of 6"}  # to scenes, and to one another
OTHERS = {name: make for name, make in MODELS.items() if name not in ALIKE}
CASES = {**SCENES, **OTHERS, "rotor": rotor, **{f"tree {k}": (lambda k=k: random_tree(k)) for k in (1,)}}


def point(model: Any, graphs: list[cg.Graph], seed: int) -> dict[str, float]:
    """A random state near the neutral one, applied forces, t, and the model's parameters."""
    rng, system = np.random.default_rng(seed), as_system(model)
    at = {f"q{i}": x + float(rng.uniform(-0.8, 0.8)) for i, x in enumerate(system.kinematics.neutral)}
    names = {name for graph in graphs for name in graph.input_names}
    at |= {name: float(rng.uniform(-0.9, 0.9)) for name in sorted(names - at.keys())}
    return at | {"t": 0.7} | dict(system.parameters)


def values(graph: cg.Graph, at: dict[str, float], stem: str = "") -> np.ndarray:
    found = graph.evaluate({name: at[name] for name in graph.input_names})
    return np.array([value for name, value in found.items() if name.startswith(stem)])


def near(found: np.ndarray, expected: np.ndarray, size: float = 0.0) -> None:
    assert np.abs(found - expected).max() <= EQUAL * max(np.abs(expected).max(), size)


def assert_lagrange(model: Any, seed: int) -> None:
    """The rates of (q, p) are those of the motion of (q, qd): p of these velocities, p_dot along this acceleration."""
    system, equations = as_system(model), dyn.hamilton_equations(model, iterations=ENOUGH)
    lagrange, momentum = dyn.state_equation(model), dyn.momentum(model)
    at = point(model, [lagrange, momentum], seed)
    at |= dict(zip([f"p{i}" for i in range(system.n)], values(momentum, at), strict=True))
    rates = equations.evaluate({name: at[name] for name in equations.input_names})
    expected = lagrange.evaluate({name: at[name] for name in lagrange.input_names})
    # backward: an ill-conditioned M turns roundings of p into large changes of the velocities
    velocities = dict(zip([f"qd{i}" for i in range(system.n)], velocity(model, at), strict=True))
    near(values(momentum, at | velocities), values(momentum, at))
    moved = cg.Graph(lagrange.inputs, {f"{i}": x for i, x in enumerate(system.q_dot)})
    near(np.array([rates[f"q{i}_dot"] for i in range(system.nq)]), values(moved, at | velocities))
    along = [str(node.name) for node in (*system.q, *system.qd)] + ["t"] * ("t" in momentum.input_names)
    rated = cg.jvp(momentum, along)
    dots = {name: expected.get(name, 1.0) for name in rated.input_names if name.endswith("_dot")}
    terms = values(cg.Graph(rated.inputs, {"p": sum(map(abs, rated.outputs.values()))}), at | dots)
    near(np.array([rates[f"p{i}_dot"] for i in range(system.n)]), values(rated, at | dots), terms[0])


def velocity(model: Any, at: dict[str, float]) -> np.ndarray:
    """qd of momenta: the slopes of H."""
    slopes = cg.gradient(energy(model), [f"p{i}" for i in range(as_system(model).n)])
    return values(slopes, at)


@cache
def energy(model: Any) -> cg.Graph:
    return dyn.hamiltonian(model, iterations=ENOUGH)


@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_the_lagrangian(name: str) -> None:
    model = CASES[name]()
    if as_ode(model) is not None:
        with pytest.raises(TypeError, match="no Lagrangian"):
            dyn.hamilton_equations(model)
    elif len(as_system(model).constraints):
        with pytest.raises(dyn.ConstraintError, match="holds the momenta"):
            dyn.hamilton_equations(model)
    else:
        assert_lagrange(model, 1)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_motion_of_random_trees_is_that_of_the_lagrangian() -> None:
    for seed in range(200):
        assert_lagrange(random_tree(seed), seed)


@pytest.mark.parametrize("model", [cart_pendulum(), oscillator(damping=0.2), relativistic(), random_tree(5)])
def test_the_energy_has_the_equations_as_its_slopes(model: Any) -> None:
    """qd = dH/dp; p_dot = -dH/dq + tau - damping qd, where velocities are rates; and H is the energy of the motion."""
    system, graph = as_system(model), dyn.hamilton_equations(model, iterations=ENOUGH, check=True)
    total = energy(model)
    at = point(model, [graph, total], 2)
    names = [f"q{i}" for i in range(system.nq)]
    u = velocity(model, at)
    moved = cg.Graph([*system.q, *system.qd], {f"{i}": node for i, node in enumerate(system.q_dot)})
    known = at | {f"qd{i}": x for i, x in enumerate(u)}
    near(values(graph, at, "q"), values(moved, known))
    E = dyn.energy(model)
    near(values(total, at), values(E, known), sum(abs(x) for x in values(dyn.kinetic_energy(model), known)))
    assert np.abs(values(graph, at, "missing")).max() <= EQUAL * max(abs(at[f"p{i}"]) for i in range(system.n))
    if system.kinematics.quasi is None:
        damping = np.array([float(each) for each in system.damping])
        applied = np.array([at[f"tau{i}"] for i in range(system.n)]) - damping * u
        near(values(graph, at, "p"), applied - values(cg.gradient(total, names), at), np.abs(applied).max())


def test_what_has_no_such_equations_is_said() -> None:
    with pytest.raises(dyn.ConstraintError, match="'coupler to rocker x' holds the momenta"):
        dyn.hamilton_equations(four_bar())
    light = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - q[1], "x y")
    with pytest.raises(ValueError, match="iterations"):
        dyn.hamiltonian(light, iterations=0)
