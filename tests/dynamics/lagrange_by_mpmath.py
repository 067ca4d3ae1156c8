"""Lagrange's equation by high-precision differences of L itself: no automatic differentiation, no graph transform."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf

import cgraph as cg
from dynamics import as_system
from tests import high_precision
from tests.dynamics.models import Array, named

DIGITS = 80
STEP = mpf(10) ** -18  # central differences: error about 1e-36, and cancellation leaves 80 - 2 * 18 digits


class Terms(NamedTuple):
    """The terms of tau = d/dt dL/dqd - dL/dq + damping qd - forces, each (n,), in mpmath numbers."""

    momentum: list[mpf]
    momentum_rate: list[mpf]
    gradient: list[mpf]
    applied: list[mpf]  # forces - damping qd

    @property
    def tau(self) -> list[mpf]:
        with mp.workdps(DIGITS):
            return [
                rate - slope - force
                for rate, slope, force in zip(self.momentum_rate, self.gradient, self.applied, strict=True)
            ]

    @property
    def largest(self) -> float:
        """The size of the largest term, [N m or N]."""
        return max(abs(float(each)) for each in [*self.momentum_rate, *self.gradient, *self.applied])


def floats(values: list[mpf]) -> Array:
    return np.array([float(each) for each in values])


def lagrange(model: Any, state: Mapping[str, Any], energy: cg.Node | None = None) -> Terms:
    """The terms at one state (q, qd, qdd, and t and parameters where the system has them); `energy` in place of L."""
    system = as_system(model)
    outputs = {"L": system.lagrangian if energy is None else energy}
    graph = system.graph(outputs, system.q, system.qd)
    forces = system.graph({f"f{i}": force for i, force in enumerate(system.forces)}, system.q, system.qd)
    with mp.workdps(DIGITS):
        x = {name: mpf(float(value)) for name, value in named(state).items()}
        point = {name: x[name] for name in graph.input_names}
        q, qd = [f"q{i}" for i in range(system.n)], [f"qd{i}" for i in range(system.n)]
        x_dot = {"t": mpf(1)}
        x_dot |= {f"q{i}": x[f"qd{i}"] for i in range(system.n)} | {f"qd{i}": x[f"qdd{i}"] for i in range(system.n)}

        def L(*moves: tuple[Mapping[str, Any], int]) -> mpf:
            moved = dict(point)
            for direction, sign in moves:
                for name, value in direction.items():
                    if name in moved:
                        moved[name] += sign * STEP * value
            return high_precision.evaluate(graph, moved, DIGITS)["L"]

        def slope(direction: Mapping[str, Any]) -> mpf:
            return (L((direction, 1)) - L((direction, -1))) / (2 * STEP)

        def mixed(a: Mapping[str, Any], b: Mapping[str, Any]) -> mpf:
            corners = [(s, r, L((a, s), (b, r))) for s in (1, -1) for r in (1, -1)]
            return sum(s * r * value for s, r, value in corners) / (4 * STEP**2)

        applied = high_precision.evaluate(forces, point, DIGITS)
        return Terms(
            momentum=[slope({name: 1}) for name in qd],
            momentum_rate=[mixed({name: 1}, x_dot) for name in qd],
            gradient=[slope({name: 1}) for name in q],
            applied=[applied[f"f{i}"] - mpf(c) * x[f"qd{i}"] for i, c in enumerate(system.damping)],
        )
