"""Loops: accelerations and loop forces against the equations that define them, in NumPy, from graphs of other parts."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.multibody.algebra.spatial import rotation
from tests.slow import slow

from ..linkages import bar, four_bar, squeezer
from ..mechanisms import random_body, random_joint
from ..models import run as values
from .test_ball_and_free import state

Array = np.ndarray[Any, np.dtype[np.float64]]
TIGHT = 1e-12  # of the largest entry: what a dense solve of the same equations leaves


def dense_kkt(model: Any, at: dict[str, float], rate: cg.Graph) -> tuple[Array, Array]:
    """(udot, lambda) of M udot - J^T lambda = tau - damping u - bias, J udot = -Jdot u, by least squares.

    rate: the rows of velocities z(q, u) = J u, inputs q0.., qd0...
    """
    system = dyn.as_system(model)
    n, m = system.n, len(rate.outputs)
    mass, bias = (values(graph, at) for graph in mass_and_bias(model))
    u = np.array([at[f"qd{i}"] for i in range(n)])
    force = np.array([at[f"tau{i}"] for i in range(n)]) - np.array(system.damping) * u - bias
    rows = jacobian(rate, at, n)
    q_dot = system.graph({f"{i}": node for i, node in enumerate(system.q_dot)}, system.q, system.qd)
    along = at | {f"q{i}_dot": x for i, x in enumerate(values(q_dot, at))}
    change = values(cg.jvp(rate, [f"q{i}" for i in range(system.nq)]), along)
    matrix = np.block([[mass.reshape(n, n), -rows.T], [rows, np.zeros((m, m))]])
    solved = np.linalg.lstsq(matrix, np.concatenate([force, -change]), rcond=1e-13)[0]
    return solved[:n], rows.T @ solved[n:]


@cache
def mass_and_bias(model: dyn.Mechanism) -> tuple[cg.Graph, cg.Graph]:
    return dyn.mass_matrix(model), dyn.bias(model)


def jacobian(rate: cg.Graph, at: dict[str, float], n: int) -> Array:
    """Rows that are linear in the velocities, by these (m, n)."""
    return np.array([values(rate, at | {f"qd{i}": float(i == k) for i in range(n)}) for k in range(n)]).T


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


@cache
def open_tree(seed: int) -> dyn.Mechanism:
    """Two chains, of 3 and 4 joints, on one of 2."""
    rng, parents = np.random.default_rng(seed), ["world", "b0", "b1", "b2", "b3", "b1", "b5", "b6", "b7"]
    kinds = ["revolute", "free", "prismatic"] + ["revolute", "ball", "prismatic"] * 2
    joints = [random_joint(kind, rng, stiffness=0.0) for kind in kinds]
    bodies = [random_body(f"b{i}", "", parent, rng, joint=joints[i]) for i, parent in enumerate(parents)]
    return dyn.Mechanism(bodies, 5.0 * rng.normal(size=3))


def closed_tree(kind: str, seed: int = 0) -> tuple[dyn.Mechanism, dyn.Loop, dict[str, float]]:
    """The two chains held together by a loop, and a state where it is closed."""
    tree, rng = open_tree(seed), np.random.default_rng(seed + 100)
    at = state(tree.system, seed, tau=1)
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
    rows = jacobian(rate, at, n)
    return at | {f"qd{i}": x for i, x in enumerate((u - np.linalg.lstsq(rows, rows @ u)[0]).tolist())}


@pytest.mark.parametrize("kind", ["hinge", "distance", *slow("point", "weld")])
def test_accelerations_and_loop_forces_solve_the_defining_equations(kind: str) -> None:
    model, loop, at = closed_tree(kind)
    tree = open_tree(0)
    expected, forces = dense_kkt(tree, at, velocity_rows(tree, loop))
    for method in ("recursive", "dense") if kind == "point" else ("recursive",):
        graph = dyn.forward_dynamics(model, method)
        found = graph.evaluate(at)
        udot = np.array([found[f"qdd{i}"] for i in range(model.system.n)])
        assert np.abs(udot - expected).max() <= TIGHT * np.abs(expected).max()
        weighted = sum(found[f"lambda{k}"] * values_of_row(model, k, at) for k in range(len(model.system.constraints)))
        assert np.abs(weighted - forces).max() <= TIGHT * np.abs(forces).max()


def values_of_row(model: dyn.Mechanism, k: int, at: dict[str, float]) -> Array:
    """J of one constraint."""
    system = model.system
    rate = cg.Graph([*system.q, *system.qd], {"z": system.constraints.rates[k]})
    return values(cg.gradient(rate, [f"qd{i}" for i in range(system.n)]), at)


def node_count(n: int) -> int:
    arm = dyn.planar_arm([1.0] * n, [0.8] * n)
    pinned = dyn.Mechanism(arm.bodies, arm.gravity, loops=[dyn.Loop("point", "tip", to_at=(1.0, 0.0, 0.0))])
    return len(dyn.forward_dynamics(pinned, "recursive").nodes)


def test_a_pinned_chain_grows_linearly() -> None:
    counts = [node_count(n) for n in (3, 4, 10, 16)]
    assert counts == [257, 395, 1229, 2063]


def test_andrews_squeezer_has_the_published_accelerations_forces_and_motion() -> None:
    model = squeezer()
    q = [-0.0617138900142764496, 0.0, 0.455279819163070380, 0.487364979543842550, 0.222668390165885885]
    q += [1.23054744454982119, -0.222668390165885885]
    at = {f"{kind}{i}": 0.0 for kind in ("qd", "tau") for i in range(7)} | {f"q{i}": x for i, x in enumerate(q)}
    found = dyn.forward_dynamics(model).evaluate(at | {"tau0": 0.033})
    assert found["qdd0"] == pytest.approx(14222.4439199541138705911625887, rel=1e-13)
    assert found["qdd1"] == pytest.approx(-10666.8329399655854029433719415, rel=1e-13)
    assert max(abs(found[f"qdd{i}"]) for i in range(2, 7)) < 1e-13 * found["qdd0"]
    assert found["lambda0"] == pytest.approx(-98.5668703962410896057654982170, rel=1e-13)
    assert found["lambda1"] == pytest.approx(6.12268834425566265503114393122, rel=1e-12)
    run = dyn.simulate(model, q, [0.0] * 7, 0.03, rtol=1e-11, tau=[0.033] + [0.0] * 6)
    final = [15.81077119629904, -15.75637105984298, 0.04082224013073101, 0.5244099658805304, -0.5347301163226948]
    assert run.q[-1] == pytest.approx([*final, 1.048080741042263, 0.5347301163226948], rel=1e-9)


@pytest.mark.parametrize(("method", "options"), [("dop853", {"rtol": 1e-9}), ("rk4", {})])
def test_a_motion_of_50_s_stays_on_its_constraints(method: str, options: dict[str, float]) -> None:
    model = four_bar()
    q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    times = np.linspace(0.0, 50.0, 301)  # between steps, too
    run = dyn.simulate(model, q, qd, 50.0, method, t_eval=times, **options)  # type: ignore[arg-type]
    constraints = model.system.constraints
    for rows, most in ((constraints.positions, 1e-12), (constraints.rates, 1e-13)):
        graph = model.system.graph({f"row{k}": node for k, node in enumerate(rows)}, model.system.q, model.system.qd)
        assert np.abs(dyn.arrays_at(model, graph, run.q, run.qd)["row"]).max() < most
    assert np.ptp(run.energy) < (1e-7 if method == "dop853" else 1e-6) * np.abs(run.energy).max()  # forces do no work


def test_a_trajectory_has_the_forces_of_its_loops_by_name() -> None:
    """Those of forward dynamics at the rows, under a held force and with parameters, too; and of a mass on a rod."""
    model = four_bar()
    q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    servo = dyn.SampledController(lambda q, qd, t: [0.3 - 0.1 * qd[0], 0.0, 0.0], 0.05)
    run = dyn.simulate(model, q, qd, 0.2, tau=servo)
    expected = dyn.arrays_at(model, dyn.forward_dynamics(model), run.q, run.qd, tau=run.tau)["lambda"]
    assert list(run.multipliers) == [f"coupler to rocker {axis}" for axis in "xyz"]
    assert np.array([*run.multipliers.values()]) == pytest.approx(expected.T, abs=1e-12)
    assert np.ptp(run.multipliers["coupler to rocker x"]) > 1.0
    assert dyn.simulate(dyn.planar_arm([1.0], [1.0]), [0.1], [0.0], 0.1).multipliers == {}


def test_a_coordinate_follows_another_as_a_polynomial() -> None:
    """q_b = 0.2 + 0.5 q_a + 0.3 q_a^2, against the Lagrangian with q_b written so; and with q_a locked."""
    wheels = [
        dyn.Body(name, dyn.Joint("revolute"), inertia=(1.0, 1.0, size)) for name, size in (("a", 1.0), ("b", 1.5))
    ]
    follow = dyn.Loop("coupling", "b", "a", coefficients=[0.2, 0.5, 0.3])
    model = dyn.Mechanism(wheels, loops=[follow])
    known = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + 0.75 * ((0.5 + 0.6 * q[0]) * qd[0]) ** 2, ["a"])
    a, rate, ratio = 0.7, 1.1, 0.5 + 0.6 * 0.7
    state = {"q0": a, "q1": 0.2 + 0.5 * a + 0.3 * a * a, "qd0": rate, "qd1": ratio * rate, "tau0": 0.4, "tau1": 0.0}
    expected = dyn.forward_dynamics(known).evaluate({"q0": a, "qd0": rate, "tau0": 0.4})["qdd0"]
    assert dyn.forward_dynamics(model).evaluate(state)["qdd0"] == pytest.approx(expected, rel=1e-14)
    spin = dyn.Body("spin", dyn.Joint("revolute", name="shaft"), "b", inertia=(1.0, 1.0, 1.0))
    whole = replace(model, bodies=[*model.bodies, spin])
    for stopped in (whole.lock("a", a), whole.lock("b", state["q1"]), whole.lock("a", a).lock("b", state["q1"])):
        assert stopped.coordinates == ("shaft",)
        assert stopped.standing == pytest.approx({"a": a, "b": state["q1"]}, rel=1e-14)
        assert dyn.simulate(stopped, [0.1], [2.0], 0.1).q[-1] == pytest.approx([0.3], rel=1e-14)
    assert whole.lock("shaft").coordinates == whole.lock("spin").coordinates == ("a", "b")
    with pytest.raises(dyn.MechanismError, match=r"no body 'shfat' to lock .* did you mean 'shaft'"):
        whole.lock("shfat")
    with pytest.raises(dyn.ConstraintError, match=r"'b to a' is open by 0\.1, and its joints are locked"):
        dyn.forward_dynamics(whole.lock("a", a).lock("b", state["q1"] + 0.1))


def test_a_redundant_loop_is_named_and_left_out() -> None:
    bars = four_bar()
    again = dyn.Loop("point", "rocker", "coupler", at=(0.6, 0, 0), to_at=(0.8, 0, 0), name="again")
    twice = dyn.Mechanism(bars.bodies, bars.gravity, loops=[*bars.loops, again])
    with pytest.warns(dyn.ConstraintWarning, match="constraints 'again x' and 'again z' follow from the others"):
        graph = dyn.forward_dynamics(twice)
    at = {f"{kind}{i}": 0.3 * i + 0.2 for kind in ("q", "qd", "tau") for i in range(3)}
    once = dyn.forward_dynamics(bars).evaluate(at)
    assert {name: value for name, value in graph.evaluate(at).items() if name in once} == once


def test_a_loop_that_cannot_close_is_named() -> None:
    long = dyn.Mechanism(
        [bar("crank", "world", 0.1, (0, 0, 0)), bar("rod", "crank", 0.2, (0.1, 0, 0))],
        loops=[dyn.Loop("point", "rod", at=(0.2, 0, 0), to_at=(0.9, 0, 0), name="far")],
    )
    with pytest.raises(dyn.ConstraintError, match="no state was seen where 'far x' is 0"):
        dyn.forward_dynamics(long)
    with pytest.raises(dyn.ConstraintError, match="cannot be moved onto the constraints: 'coupler to rocker"):
        dyn.simulate(four_bar(), [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 1.0)


def test_a_loop_among_locked_joints_is_a_weld() -> None:
    model = four_bar()
    q, _ = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    free = bar("load", "coupler", 0.2, (0.4, 0, 0))
    loaded = dyn.Mechanism([*model.bodies, free], model.gravity, loops=model.loops)
    stiff = loaded
    for name, at in zip(("crank", "coupler", "rocker"), q.tolist(), strict=True):
        stiff = stiff.lock(name, at)
    welded = dyn.Mechanism(stiff.bodies, stiff.gravity, locked=stiff.locked)
    at = {"q0": 0.3, "qd0": 0.5, "tau0": 0.7}
    assert dyn.forward_dynamics(stiff).evaluate(at)["qdd0"] == dyn.forward_dynamics(welded).evaluate(at)["qdd0"]


def test_a_body_taken_off_takes_its_loops_along_and_brings_them_back() -> None:
    model = four_bar()
    taken, rest = model.subtree("rocker"), model.detach("rocker")
    assert rest.loops == ()
    back = rest.attach(taken)
    assert [loop.label for loop in back.loops] == ["coupler to rocker"]
    at = {f"{kind}{i}": 0.3 * i + 0.2 for kind in ("q", "qd", "tau") for i in range(3)}
    assert dyn.forward_dynamics(back).evaluate(at) == dyn.forward_dynamics(model).evaluate(at)
    with pytest.raises(dyn.MechanismError, match="there is a loop on the unknown body 'coupler'"):
        model.detach("rocker").detach("coupler").attach(taken)
    q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    let = dyn.release(model, q, qd, "rocker")
    assert let.mechanism.loops == ()
    assert (let.q.tolist(), let.qd.tolist()) == (q[:2].tolist(), qd[:2].tolist())


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau"])
def test_a_linkage_that_is_locked_stands(method: str) -> None:
    """Accelerations are rounding alone there, by which no steps can be chosen."""
    model = four_bar()
    q, _ = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    run = dyn.simulate(model.lock("crank", q[0]), q[1:], [0.0, 0.0], 1.0, method, max_steps=2000)
    assert run.success
    assert np.abs(run.q - q[1:]).max() < 1e-15
    assert np.ptp(run.multipliers["coupler to rocker z"]) < 1e-12


def test_a_body_caught_by_a_closed_chain_leaves_it_closed() -> None:
    """Impulses of the loop are J^T s: M qd+ - p does no work on a motion that the loop lets through."""
    model = four_bar()
    q, qd = nearest_state(model, [1.0, -0.8, 1.5], [5.0, 0.0, 0.0])
    load = dyn.Body("load", dyn.Joint("fixed", position=(0.4, 0.0, 0.1)), "coupler", 0.7, inertia=(0.01, 0.02, 0.01))
    caught = dyn.attach_with_impact(model, q, qd, load, velocity=(1.0, 0.0, -2.0))
    assert len(caught.mechanism.loops) == 1
    at = {f"q{i}": x for i, x in enumerate(q)} | {f"qd{i}": x for i, x in enumerate(caught.qd)}
    rows = np.array([values_of_row(caught.mechanism, k, at) for k in (0, 2)])
    assert np.abs(rows @ caught.qd).max() < 1e-14 * np.abs(caught.qd).max()
    assert caught.energy > 0.0
    whole = dyn.Mechanism(caught.mechanism.bodies, (0.0, 0.0, 0.0))
    free, spin = (
        np.linalg.svd(rows)[2][2],
        dyn.attach_with_impact(dyn.Mechanism(model.bodies, (0.0, 0.0, 0.0)), q, qd, load, velocity=(1.0, 0.0, -2.0)),
    )
    mass = values(dyn.mass_matrix(whole), at).reshape(3, 3)
    assert free @ mass @ caught.qd == pytest.approx(free @ mass @ spin.qd, rel=1e-12)  # of the tree: M qd = p


@pytest.mark.parametrize("angle", [2.0 * np.pi / 3.0, 3.0])
def test_a_weld_turns_a_body_to_its_place_from_nearly_half_a_turn_away(angle: float) -> None:
    """And not to another where axes are at right angles; by a third of a turn about (1, 1, 1) they all are."""
    axis = np.full(3, 3.0**-0.5)
    orientation = rotation(axis, angle)
    body = dyn.Body("b", dyn.Joint("free"), "world", 1.0, inertia=(1.0, 1.0, 1.0))
    model = dyn.Mechanism([body], loops=[dyn.Loop("weld", "b", orientation=orientation)])
    q, u = nearest_state(model, [0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0], np.ones(6))
    quaternion = [np.cos(angle / 2.0), *(np.sin(angle / 2.0) * axis)]
    assert q == pytest.approx([0.0, 0.0, 0.0, *quaternion], abs=1e-15)
    assert np.abs(u).max() < 1e-15
