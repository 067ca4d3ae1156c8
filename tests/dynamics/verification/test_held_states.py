"""Held states: what rows of constraints leave of the inertia."""

from typing import Any

import numpy as np
import pytest
from pytest import approx

import cgraph as cg
import dynamics as dyn
from dynamics.verification.held_states import Held


@pytest.mark.parametrize("unit", [1e-12, 1e-3, 1.0, 1e6])
def test_the_admitted_motions_of_any_units_are_scaled_to_their_kinetic_energy(unit: float) -> None:
    """By the diagonal of M: what is left has the eigenvalues of M beside it, of the motions that a row admits."""
    masses = np.array([2.0, 3.0 * unit, 0.5])

    def energy(q: Any, qd: Any, t: Any) -> Any:
        return 0.5 * sum(m * x * x for m, x in zip(masses.tolist(), qd, strict=True))

    def row(q: Any, qd: Any, t: Any) -> Any:
        return {"joined": qd[0] - 0.7 * qd[1]}

    def value(graph: cg.Graph) -> np.ndarray:
        return np.array([[*graph.evaluate(dict.fromkeys(graph.input_names, 0.3)).values()]])

    size = np.sqrt(masses)
    inertia = np.outer(size, size) * [[1.0, 0.5, 0.1], [0.5, 1.0, -0.3], [0.1, -0.3, 1.0]]
    basis = np.array([[0.7, 0.0], [1.0, 0.0], [0.0, 1.0]])
    whole, diagonal = (basis.T @ each @ basis for each in (inertia, np.diag(masses)))
    expected = np.sort(np.linalg.eigvals(np.linalg.solve(diagonal, whole)))
    held = Held(dyn.System(energy, "x y z", velocity_constraints=row), value)
    assert np.linalg.eigvalsh(held.admitted(inertia[None])[0]) == approx(expected, rel=1e-12)
