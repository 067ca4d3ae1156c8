"""Inverse dynamics by velocities: trees of all joints and random Lagrangians, beside the chain rule in 60 digits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from pytest import mark

import cgraph as cg
import dynamics as dyn
from cgraph import structure_hash
from dynamics.equations.formulations.formulations import SMALL
from dynamics.experiments.trust.random_motions import LAGRANGIANS, random_task
from dynamics.multibody.joints import COMPOSITIONS, TYPES
from dynamics.multibody.trees.mechanism import WORLD, Body, Joint, Mechanism
from tests.dynamics.mechanisms import (
    TREES as MODELS,
    random_body,
    random_joint,
    random_mechanism,
    random_state,
    turned_arm,
)
from tests.dynamics.units import Units, in_units
from tests.high_precision import evaluate, rounding_size
from tests.slow import slow

DIGITS = 60
TREES, QUICK = 160, 12
ROUNDING = 1e-14  # of the largest torque: some thousand operations, and inertial numbers that are rounded
SAME = 1e-13  # of the terms of a torque: two ways of rounding
ZERO_STIFFNESS = {"stiffness": 0.0, "spring_reference": 0.0}


def tree_of_all_joints(seed: int) -> Mechanism:
    """Two to seven bodies on joints of any kind, with springs and armatures where they can have them."""
    rng = np.random.default_rng((seed, 7))
    n, kinds = 2 + seed % 6, [*TYPES, *COMPOSITIONS]
    reach, bodies = int(rng.choice([1, 2, n])), []
    for i in range(n):
        kind = str(rng.choice(kinds if i else [each for each in kinds if each != "fixed"]))
        type_ = TYPES.get(kind)
        others = {} if type_ is None or type_.sprung else ZERO_STIFFNESS
        others |= {"spring_reference": 0.0} if kind == "ball" else {}
        others |= {} if type_ is None or (type_.geared and type_.moves) else {"armature": 0.0}
        parent = f"b{rng.integers(max(0, i - reach), i)}" if i else WORLD
        bodies.append(random_body(f"b{i}", kind, parent, rng, joint=random_joint(kind, rng, **others)))
    return Mechanism(bodies, 5.0 * rng.normal(size=3), base_parameters=bool(rng.random() < 0.2))


def state_of(model: Mechanism, seed: int) -> dict[str, float]:
    q, qd, qdd, _ = random_state(model, seed)
    return {f"{name}{i}": float(x) for name, row in zip(("q", "qd", "qdd"), (q, qd, qdd), strict=True)
            for i, x in enumerate(row)}  # fmt: skip


def differences(model: dyn.System | Mechanism, formulation: str | None, at: Mapping[str, float]) -> tuple[float, float]:
    """The largest error of a torque beside the chain rule in 60 digits, and the largest torque."""
    graph = dyn.inverse_dynamics(model, *([] if formulation is None else [formulation]))
    found = graph.evaluate({name: at[name] for name in graph.input_names})
    exact = evaluate(dyn.inverse_dynamics(model, "chain_rule", simplify=False), at, DIGITS)
    errors = [abs(float(exact[name] - found[name])) for name in exact]
    return max(errors), max(abs(float(value)) for value in exact.values())


@mark.parametrize("seed", [*range(QUICK), *slow(*range(QUICK, TREES))])
def test_torques_of_a_tree_of_all_joints_are_right_to_rounding(seed: int) -> None:
    model = tree_of_all_joints(seed)
    error, largest = differences(model, "newton_euler", state_of(model, seed))
    assert error < ROUNDING * largest


def test_the_trees_have_every_joint() -> None:
    kinds = {body.joint.kind for seed in range(TREES) for body in tree_of_all_joints(seed).bodies}
    assert kinds == {*TYPES, *COMPOSITIONS}


@mark.parametrize("number", [*range(0, LAGRANGIANS, 9), *slow(*[k for k in range(LAGRANGIANS) if k % 9])])
def test_torques_of_a_random_lagrangian_are_those_of_the_chain_rule(number: int) -> None:
    task = random_task(number)
    rng, n = np.random.default_rng(number), task.system.n
    parts = {"q": np.array(task.q) + 0.1 * rng.normal(size=n) * np.abs(task.q), "qd": np.array(task.qd)}
    parts["qdd"] = rng.normal(size=n) * np.abs(task.q)
    at = {f"{name}{i}": float(x) for name, row in parts.items() for i, x in enumerate(row)} | {"t": 0.7}
    by_velocities, right = (dyn.inverse_dynamics(task.system, each) for each in ("newton_euler", "chain_rule"))
    values = [graph.evaluate({name: at[name] for name in graph.input_names}) for graph in (by_velocities, right)]
    for name, size in rounding_size(right, at).items():
        assert abs(values[0][name] - values[1][name]) <= SAME * max(size, abs(values[1][name]))


def test_without_a_name_the_smaller_graph_is_taken() -> None:
    hinge, seven = dyn.planar_arm([1.3], [0.7], damping=0.1), turned_arm(7)
    sizes = {name: [len(dyn.inverse_dynamics(model, name).nodes) for model in (hinge, seven)] for name in SMALL}
    assert [len(dyn.inverse_dynamics(model).nodes) for model in (hinge, seven)] == [
        min(counts) for counts in zip(*sizes.values(), strict=True)
    ]
    assert sizes["newton_euler"][1] < 0.6 * sizes["chain_rule"][1]
    screw = Body("screw", Joint("screw", (1.0, 0.0, 0.0), pitch=0.2), mass=2.0, inertia=(0.1, 0.2, 0.3))
    slides = [Body(f"slide {i}", Joint("prismatic", np.eye(3)[i % 3]), f"slide {i - 1}" if i else WORLD, mass=1.0 + i)
              for i in range(12)]  # fmt: skip
    for model in (Mechanism([screw]), Mechanism(slides)):
        least = len(dyn.inverse_dynamics(model, "chain_rule").nodes)
        assert len(dyn.inverse_dynamics(model).nodes) == least < len(dyn.inverse_dynamics(model, "newton_euler").nodes)
        raw = [dyn.inverse_dynamics(model, *name, simplify=False) for name in ((), ("chain_rule",))]
        assert structure_hash(raw[0]) == structure_hash(raw[1])


def plain_arm(n: int) -> dyn.System:
    """Rods one after the other in the coordinates of their angles, written by the velocities of their centers."""

    def lagrangian(q, qd, t):
        partials, x, y, height = [], cg.constant(0.0), cg.constant(0.0), cg.constant(0.0)
        angle, omega = cg.constant(0.0), cg.constant(0.0)
        for turn, rate in zip(q, qd, strict=True):
            angle, omega = angle + turn, omega + rate
            c, s = cg.cos(angle), cg.sin(angle)
            u, v = x + 0.4 * omega * c, y + 0.4 * omega * s
            partials.append(0.7 * (u * u + v * v) + 0.05 * omega * omega - 9.81 * 1.4 * (height - 0.4 * c))
            x, y, height = x + 0.8 * omega * c, y + 0.8 * omega * s, height - 0.8 * c
        return partials

    return dyn.System(lagrangian, [f"a{i}" for i in range(n)])


def test_of_a_lagrangian_written_by_velocities_less_is_formed() -> None:
    for n, nodes in ((10, 511), (20, 1061)):
        arm = plain_arm(n)
        assert len(dyn.inverse_dynamics(arm, "newton_euler").nodes) <= nodes
        assert len(dyn.inverse_dynamics(arm, "chain_rule").nodes) > 1.5 * nodes
        at = {name: np.sin(i) for i, name in enumerate(dyn.inverse_dynamics(arm, "chain_rule").input_names)}
        error, largest = differences(arm, "newton_euler", at)
        assert error < ROUNDING * largest


def test_in_a_turned_world_torques_are_the_same() -> None:
    model = tree_of_all_joints(5)
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    bodies = [
        replace(
            body,
            joint=replace(body.joint, position=turn @ body.joint.position, orientation=turn @ body.joint.orientation),
        )
        if body.parent == WORLD
        else body
        for body in model.bodies
    ]
    turned = replace(model, gravity=turn @ np.asarray(model.gravity), bodies=bodies)
    at = state_of(model, 5)
    assert relative(torques(turned)(at), torques(model)(at)) < ROUNDING


@mark.parametrize("seed", range(6))
def test_in_any_order_of_the_bodies_torques_are_the_same(seed: int) -> None:
    model = random_mechanism(6, ["revolute", "prismatic", "screw"], 6, seed)
    mixed = replace(model, bodies=[model.bodies[k] for k in np.random.default_rng(seed).permutation(6)])
    at = state_of(model, seed)
    place = [model.coordinates.index(name) for name in mixed.coordinates]
    moved = {f"{name}{i}": at[f"{name}{k}"] for name in ("q", "qd", "qdd") for i, k in enumerate(place)}
    tau, again = torques(model)(at), torques(mixed)(moved)
    assert relative(again, {f"tau{i}": tau[f"tau{k}"] for i, k in enumerate(place)}) < ROUNDING


@mark.parametrize("seed", range(6))
def test_in_units_of_powers_of_two_torques_are_the_same_to_the_bit(seed: int) -> None:
    model = random_mechanism(5, ["revolute", "prismatic"], 3, seed)
    units, at = Units(2.0**9, 2.0**-7, 2.0**5), state_of(model, seed)
    sizes = units.of(model)
    rates = {"q": 1.0, "qd": 1.0 / units.time, "qdd": units.time**-2}
    moved = {f"{name}{i}": at[f"{name}{i}"] * x * y for name, y in rates.items() for i, x in enumerate(sizes)}
    tau, again = torques(model)(at), torques(in_units(model, units))(moved)
    assert [again[f"tau{i}"] * x / units.energy for i, x in enumerate(sizes)] == list(tau.values())


def test_products_of_two_coordinates_and_quasi_velocities_fall_back_to_the_velocities_themselves() -> None:
    """No velocity node but qd is known there, and none may be made up."""
    bent = dyn.System(
        lambda q, qd, t: (
            0.5 * (q[1] * qd[0] + q[0] * qd[1] + 2.0 * cg.sin(t)) ** 2 + 0.5 * (q[1] * qd[0]) ** 2 + qd[1] ** 2
        ),
        "x y",
    )
    at = {"q0": 0.4, "q1": -0.7, "qd0": 1.1, "qd1": 0.3, "qdd0": -0.8, "qdd1": 2.0, "t": 0.3}
    error, largest = differences(bent, "newton_euler", at)
    assert error < ROUNDING * largest
    body = MODELS["balls"]()
    at = state_of(body, 3)
    plain = dyn.System(
        lambda q, qd, t: list(body.system.partial_lagrangians),
        body.coordinates,
        quasi_velocities=body.system.kinematics.quasi,
    )
    error, largest = differences(plain, "newton_euler", at)
    assert error < ROUNDING * largest


def torques(model: Mechanism) -> Callable[[Mapping[str, float]], dict[str, float]]:
    return dyn.inverse_dynamics(model, "newton_euler").evaluate


def relative(found: Mapping[str, float], expected: Mapping[str, float]) -> float:
    """The largest difference, of the largest."""
    return max(abs(found[name] - x) for name, x in expected.items()) / max(map(abs, expected.values()))
