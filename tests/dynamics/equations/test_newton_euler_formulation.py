"""Inverse dynamics by velocities: trees of all joints and random Lagrangians, beside the chain rule in 60 digits."""

from collections.abc import Mapping

import cgraph as cg
import dynamics as dyn
from dynamics import Mechanism
from tests.dynamics.mechanisms import TREES as MODELS, random_state
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
