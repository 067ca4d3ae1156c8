"""Torque by cause: what adds up to tau, each part against the model with a body changed or an effect switched off."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import torque_by_cause
from dynamics.multibody.changes.pruning import without_effect
from tests.dynamics.mechanisms import EVERY_KIND, random_state, random_tree
from tests.each_row import each_row
from tests.tolerances import EQUATIONS, LONG_SUM, TORQUES

SEEDS = range(4)
STEPPED = ("by_definition", "kinetic_only", "kinetic_only_exact")


@cache
def forced_tree(seed):
    """A random tree under gravity, with springs, damping and armature, and forces of every kind."""
    tree = random_tree(seed, 5, EVERY_KIND)
    hinge = next(body.name for body in tree.bodies if body.joint.kind in ("revolute", "prismatic", "screw"))
    forces = [
        dyn.Force(tree.bodies[-1].name, (1.0, "push", 0.5), at=(0.1, 0.2, 0.3), torque=(0.3, 0.2, -0.1)),
        dyn.JointFriction(hinge, loss=0.7, velocity=0.5),
        dyn.JointLimit(hinge, -0.01, 0.01, stiffness=50.0, damping=0.1),
        dyn.Actuator(hinge, "target", gain=(3.0, 0.0, 0.0), bias=(0.0, -3.0, -0.2)),
    ]
    return replace(tree, forces=forces, parameters={"push": 0.4, "target": 0.3})


def torque(model, q, qd, qdd):
    return dyn.arrays_at(model, dyn.inverse_dynamics(model), q, qd, qdd)["tau"]


def part(table, word):
    chosen = [
        row for name, row in zip(table.rows, table.values, strict=True) if name.startswith(word) or name.endswith(word)
    ]
    return np.sum(chosen, axis=0) if chosen else np.zeros(len(table.columns))


@each_row("seed", SEEDS)
def test_causes_add_up_to_the_torque(seed):
    tree = forced_tree(seed)
    q, qd, qdd, _ = random_state(tree, seed)
    table = torque_by_cause(tree).at(q, qd, qdd)
    sizes = np.abs(table.values).sum(axis=0)
    assert np.all(np.abs(table.total - torque(tree, q, qd, qdd)) <= EQUATIONS * (sizes + sizes.max()))
    assert {name.split()[0] for name in table.rows} >= {
        "gravity",
        "inertia",
        "damping",
        "force",
        "friction",
        "limit",
        "actuator",
    }


@each_row("seed", SEEDS)
def test_a_body_has_what_another_of_its_kind_would_add(seed):
    """Torques are linear in mass and inertia: with those of body k twice, its parts are there twice."""
    tree = replace(random_tree(seed, 4, EVERY_KIND), gravity=(1.0, -2.0, 9.0))
    q, qd, qdd, _ = random_state(tree, seed)
    table, tau = torque_by_cause(tree).at(q, qd, qdd), torque(tree, q, qd, qdd)
    for k, body in enumerate(tree.bodies):
        if not body.joint.moves or any(other.parent == body.name and not other.joint.moves for other in tree.bodies):
            continue
        joint = replace(body.joint, armature=2.0 * body.joint.armature)
        twice = replace(body, mass=2.0 * body.mass, inertia=2.0 * np.asarray(body.inertia), joint=joint)
        other = replace(tree, bodies=[*tree.bodies[:k], twice, *tree.bodies[k + 1 :]])
        own = {name: row for name, row in zip(table.rows, table.values, strict=True) if not name.startswith("spring")}
        mine = np.sum([row for name, row in own.items() if name.split(" of ")[-1].split(".")[0] == body.name], axis=0)
        more = torque(other, q, qd, qdd) - tau
        assert np.all(np.abs(more - mine) <= TORQUES * (np.abs(table.values).sum(axis=0).max() + np.abs(more).max()))


@each_row("seed", SEEDS)
def test_a_cause_is_what_goes_when_it_is_switched_off(seed):
    tree = forced_tree(seed)
    q, qd, qdd, _ = random_state(tree, seed)
    still = np.zeros_like(qd)
    table, whole = torque_by_cause(tree).at(q, qd, qdd), torque(tree, q, qd, qdd)
    without = {
        "gravity": torque(without_effect(tree, "gravity"), q, qd, qdd),
        "spring": torque(without_effect(tree, "springs"), q, qd, qdd),
        "damping": torque(without_effect(tree, "damping"), q, qd, qdd),
        "inertia": torque(tree, q, qd, still),
    }
    bare = without_effect(without_effect(tree, "forces"), "damping")
    size = np.abs(table.values).sum(axis=0).max()
    for cause, rest in without.items():
        assert np.all(np.abs(part(table, cause) - (whole - rest)) <= TORQUES * size), cause
    coriolis = torque(bare, q, qd, still) - torque(bare, q, still, still)
    assert np.all(np.abs(part(table, "Coriolis") - coriolis) <= TORQUES * size)
    for force in tree.forces:
        rest = torque(
            replace(
                tree,
                forces=[each for each in tree.forces if each is not force],
                parameters={name: value for name, value in tree.parameters.items() if name not in force.names},
            ),
            q,
            qd,
            qdd,
        )
        kind = type(force).__name__.removeprefix("Joint").lower()
        assert np.all(np.abs(part(table, kind) - (whole - rest)) <= TORQUES * size), kind


@each_row("formulation, seed", [(name, k) for k, name in enumerate(STEPPED)])
def test_of_the_embedded_formulations_what_is_spurious_is_a_cause(formulation, seed):
    tree = forced_tree(seed)
    graph, table = dyn.inverse_dynamics(tree, formulation), torque_by_cause(tree, formulation)
    assert table.graph.input_names == graph.input_names
    rng = np.random.default_rng(seed)
    system = tree.system
    neutral = {f"q{i}_old": x for i, x in enumerate(system.kinematics.neutral)}
    at = {name: neutral.get(name, 0.0) + rng.uniform(-0.5, 0.5) for name in graph.input_names} | dict(tree.parameters)
    for dt in (0.05, 1e-9):
        at["dt"] = dt
        tau, parts = graph.evaluate(at), table.graph.evaluate(at)
        for i in range(system.n):
            column = [parts[f"tau{i}_{k}"] for k in range(len(table.rows))]
            assert abs(sum(column) - tau[f"tau{i}"]) <= EQUATIONS * sum(map(abs, column))
    spurious = [k for k, name in enumerate(table.rows) if name.startswith("spurious")]
    terms = dyn.formulation_verdict(tree, formulation).terms
    if formulation == "kinetic_only_exact":
        assert not spurious
        assert terms is None
        return
    state = {name.replace("_old", ""): value for name, value in at.items()}
    excess = terms.evaluate({name: state[name] for name in terms.input_names})
    for i in range(system.n):  # at dt = 1e-9 s it is what the verdict says, and the step leaves nothing
        found = sum(parts[f"tau{i}_{k}"] for k in spurious)
        assert found == pytest.approx(excess[f"tau{i}"], rel=1e-6, abs=1e-6)
        assert abs(parts[f"tau{i}_{table.rows.index('step of dt')}"]) < 1e-6


def test_terms_of_a_potential_energy_are_told_by_their_formulas():
    def lagrangian(q, qd, t, p):
        kinetic = 0.5 * p["m"] * (qd[0] ** 2 + (q[0] * qd[1]) ** 2)
        return kinetic + p["m"] * p["g"] * q[0] * cg.cos(q[1]) - 0.5 * p["k"] * (q[0] - 1.0) ** 2

    pendulum = dyn.System(lagrangian, "r theta", {"m": 2.0, "g": 10.0, "k": 30.0}, forces=lambda q, qd, t: [0.0, -3.0])
    table = torque_by_cause(pendulum).at([1.5, 0.0], [0.0, 2.0], [1.0, 0.0])
    assert table.rows[2:] == ("Coriolis", "inertia", "applied forces")
    assert table.rows[0].startswith("potential -m * g * q.r")
    assert table.rows[1].startswith("potential 0.5 * k")
    # -m g cos theta; k (r - 1); -m r thetad^2; m rdd; the force, which tau has to hold
    assert table.values[:, 0] == pytest.approx([-20.0, 15.0, -12.0, 2.0, 0.0], rel=LONG_SUM)
    assert table.values[:, 1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 3.0], abs=LONG_SUM)


def test_what_nothing_moves_has_no_torque():
    still = torque_by_cause(dyn.System(lambda q, qd, t: 0.0 * qd[0], "x")).at([1.0], [1.0], [1.0])
    assert (still.rows, still.total.tolist()) == (("inertia",), [0.0])


def test_base_parameters_change_no_cause():
    arm = random_tree(4, 4, ["revolute"], "revolute")
    q, qd, qdd, _ = random_state(arm, 0)
    fewest = replace(arm, base_parameters=True)
    own, same = (torque_by_cause(each).at(q, qd, qdd) for each in (arm, fewest))
    assert own.rows == same.rows
    assert np.array_equal(own.values, same.values)


def test_an_embedded_table_has_the_state_before_the_step():
    table = torque_by_cause(dyn.planar_arm([1.0], [1.0]), "by_definition")
    with pytest.raises(ValueError, match="before the step"):
        table.at([0.0])
    with pytest.raises(ValueError, match="formulation"):
        torque_by_cause(dyn.planar_arm([1.0], [1.0]), "none")
