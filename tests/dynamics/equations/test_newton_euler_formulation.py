"""Inverse dynamics by velocities: trees of all joints and random Lagrangians, beside the chain rule in 60 digits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph import structure_hash
from dynamics import Body, Joint, Mechanism
from dynamics.equations.formulations.lagrange_terms import SMALL
from dynamics.multibody.trees.mechanism import WORLD
from tests.dynamics.mechanisms import (
    TREES as MODELS,
    random_state,
    turned_arm,
)
from tests.high_precision import evaluate

DIGITS = 60
ROUNDING = 1e-14  # of the largest torque: some thousand operations, and inertial numbers that are rounded


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
