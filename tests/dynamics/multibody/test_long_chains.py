"""Accelerations of long chains in floats, against a dense solve in 60 digits or more by another algorithm."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import dynamics as dyn
from cgraph.extend import Array
from dynamics.multiprecision import chain_equations
from tests.dynamics import planar_arm_equations
from tests.dynamics.mechanisms import turned_arm

pytest.importorskip("flint")

# Errors of elimination grow slowly, some eps n; the dense factorisation of M loses what cond(M), about n^4, takes.
TOLERANCE = {10: 1e-14, 100: 1e-12, 300: 1e-12}


def planar(n: int) -> dyn.Mechanism:
    return dyn.planar_arm(
        [0.2 + 0.05 * (i % 3) for i in range(n)], [0.2 + 0.1 * (i % 2) for i in range(n)], damping=0.1
    )


KINDS = {"planar": (planar, planar_arm_equations), "3D": (turned_arm, chain_equations)}


def error(kind: str, n: int, spread: float, method: str = "recursive") -> float:
    """The largest error at a state with joint angles within +-spread, relative to the largest acceleration."""
    make, reference = KINDS[kind]
    model: Any = make(n)
    rng = np.random.default_rng(n)
    q, qd, tau = rng.uniform(-spread, spread, n), rng.normal(size=n), rng.normal(size=n)
    exact = reference.accelerations(model, q, qd, tau).high
    graph = dyn.forward_dynamics(model, method)
    found: Array = np.array(list(graph.evaluate(dict(zip(graph.input_names, [*q, *qd, *tau], strict=True))).values()))
    return float(np.abs(found - exact).max() / np.abs(exact).max())


@pytest.mark.parametrize("spread", [0.1, math.pi])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3, 10])
def test_short_chains(n, kind, spread):
    assert error(kind, n, spread) < TOLERANCE[10]


def test_a_dense_solve_is_seen_to_be_less_accurate():
    """Test the test: an error of 1e-12 does not pass for none."""
    assert error("planar", 15, 0.1, "dense") > 10 * TOLERANCE[10] > 10 * error("planar", 15, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.1, math.pi])
@pytest.mark.parametrize(("kind", "n"), [("planar", 100), ("planar", 300), ("3D", 100)])
def test_long_chains(kind, n, spread):
    assert error(kind, n, spread) < TOLERANCE[n]
