"""Loops: accelerations and loop forces against the equations that define them, in NumPy, from graphs of other parts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn

from ..mechanisms import random_body

Array = np.ndarray[Any, np.dtype[np.float64]]
TIGHT = 1e-12  # of the largest entry: what a dense solve of the same equations leaves


def state_of(model: Any, seed: int = 0) -> dict[str, float]:
    rng, system = np.random.default_rng(seed), dyn.as_system(model)
    names = [str(node.name) for node in (*system.q, *system.qd, *system.tau)]
    return {name: float(rng.normal()) for name in names}


def values(graph: cg.Graph, at: dict[str, Any]) -> Array:
    return np.array(list(graph.evaluate({name: at[name] for name in graph.input_names}).values()))


def dense_kkt(model: Any, at: dict[str, float], rate: cg.Graph) -> tuple[Array, Array]:
    """(udot, lambda) of M udot - J^T lambda = tau - damping u - bias, J udot = -Jdot u, by least squares.

    rate: the rows of velocities z(q, u) = J u, inputs q0.., qd0...
    """
    system = dyn.as_system(model)
    n, m = system.n, len(rate.outputs)
    mass = values(dyn.mass_matrix(model), at).reshape(n, n)
    u = np.array([at[f"qd{i}"] for i in range(n)])
    force = np.array([at[f"tau{i}"] for i in range(n)]) - np.array(system.damping) * u - values(dyn.bias(model), at)
    basis = [at | {f"qd{i}": float(i == k) for i in range(n)} for k in range(n)]
    rows = np.array([values(rate, each) for each in basis]).T
    along = at | {f"q{i}_dot": x for i, x in enumerate(values(q_dot(system), at))}
    change = values(cg.jvp(rate, [f"q{i}" for i in range(system.nq)]), along)
    matrix = np.block([[mass, -rows.T], [rows, np.zeros((m, m))]])
    solved = np.linalg.lstsq(matrix, np.concatenate([force, -change]), rcond=1e-13)[0]
    return solved[:n], rows.T @ solved[n:]


def q_dot(system: dyn.System) -> cg.Graph:
    return cg.Graph([*system.q, *system.qd], {f"{i}": node for i, node in enumerate(system.q_dot)})


def velocity_rows(model: dyn.Mechanism, loop: dyn.Loop) -> cg.Graph:
    """What a loop holds at zero, from how its two bodies move in the world: the relative velocity, and rotation."""
    q, qd = model.system.q, model.system.qd
    state = [*q, *qd]
    ends = []
    for body, at in ((loop.body, loop.at), (loop.to, loop.to_at)):
        ends.append(model.motion(body, at)(*state))
    (a, b), rows = ends, {}
    for axis in "xyz":
        rows[f"v{axis}"] = a[f"v{axis}"] - b[f"v{axis}"]
        rows[f"w{axis}"] = a[f"w{axis}"] - b[f"w{axis}"]
    if loop.kind == "point":
        rows = {name: row for name, row in rows.items() if name[0] == "v"}
    if loop.kind == "distance":
        gap = [a[x] - b[x] for x in "xyz"]
        rows = {"d": sum(g * rows[f"v{x}"] for g, x in zip(gap, "xyz", strict=True))}
    if loop.kind == "hinge":
        turned = np.asarray(loop.to_axis, dtype=float)
        axis = [sum(b[f"R_{i}_{j}"] * float(turned[j]) for j in range(3)) for i in range(3)]
        w = [rows.pop(f"w{x}") for x in "xyz"]
        rows |= {f"w{i}": w[(i + 1) % 3] * axis[(i + 2) % 3] - w[(i + 2) % 3] * axis[(i + 1) % 3] for i in range(3)}
    return cg.Graph(state, rows)


def closed_tree(kind: str, seed: int = 0) -> tuple[dyn.Mechanism, dyn.Loop, dict[str, float]]:
    """Two chains of 4 and 3 joints on the second of 2 others, held together by a loop; and a state where it is closed."""
    rng, parents = np.random.default_rng(seed), ["world", "b0", "b1", "b2", "b3", "b1", "b5", "b6", "b7"]
    kinds = ["revolute", "revolute", "prismatic"] * 3
    bodies = [random_body(f"b{i}", kinds[i], parent, rng) for i, parent in enumerate(parents)]
    tree = dyn.Mechanism(bodies, 5.0 * rng.normal(size=3))
    at = state_of(tree, seed)
    motions = [values(tree.motion(name), at) for name in ("b8", "b4")]
    (place, turn), (place_to, turn_to) = ((each[:3], each[9:].reshape(3, 3)) for each in motions)
    offset = 0.2 * rng.normal(size=3)
    apart = place + turn @ offset - place_to
    axis = rng.normal(size=3)
    loop = dyn.Loop(
        kind,
        "b8",
        "b4",
        at=offset,
        to_at=turn_to.T @ apart if kind != "distance" else (0.0, 0.0, 0.0),
        axis=axis,
        to_axis=turn_to.T @ turn @ axis,
        orientation=turn_to.T @ turn,
        length=float(np.linalg.norm(apart)),
    )
    return dyn.Mechanism(tree.bodies, tree.gravity, loops=[loop]), loop, held_still(tree, velocity_rows(tree, loop), at)


def held_still(model: dyn.Mechanism, rate: cg.Graph, at: dict[str, float]) -> dict[str, float]:
    """The state with velocities that the rows of velocities allow."""
    n = model.system.n
    u = np.array([at[f"qd{i}"] for i in range(n)])
    rows = np.array([values(rate, at | {f"qd{i}": float(i == k) for i in range(n)}) for k in range(n)]).T
    return at | {f"qd{i}": x for i, x in enumerate((u - np.linalg.lstsq(rows, rows @ u)[0]).tolist())}


@pytest.mark.parametrize("kind", ["point", "hinge", "weld", "distance"])
def test_accelerations_and_loop_forces_solve_the_defining_equations(kind: str) -> None:
    model, loop, at = closed_tree(kind)
    tree = dyn.Mechanism(model.bodies, model.gravity)
    expected, forces = dense_kkt(tree, at, velocity_rows(tree, loop))
    for method in ("recursive", "dense"):
        graph = dyn.forward_dynamics(model, method)
        found = graph.evaluate(at)
        udot = np.array([found[f"qdd{i}"] for i in range(9)])
        assert np.abs(udot - expected).max() <= TIGHT * np.abs(expected).max()
        weighted = sum(found[f"lambda{k}"] * values_of_row(model, k, at) for k in range(len(model.system.constraints)))
        assert np.abs(weighted - forces).max() <= TIGHT * np.abs(forces).max()


def values_of_row(model: dyn.Mechanism, k: int, at: dict[str, float]) -> Array:
    """J of one constraint."""
    system = model.system
    rate = cg.Graph([*system.q, *system.qd], {"z": system.constraints.rates[k]})
    return values(cg.gradient(rate, [f"qd{i}" for i in range(system.n)]), at)
