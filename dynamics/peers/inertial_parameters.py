"""Inertial parameters: a mechanism whose masses, centers and inertias are parameters, ten numbers a body with mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..multibody.body import Body
from ..multibody.mechanism import Mechanism


def with_inertial_parameters(mechanism: Mechanism) -> tuple[Mechanism, dict[str, float]]:
    """The mechanism, and {name: value} of the new parameters; the mechanism has no parameters yet."""
    bodies: list[Body] = []
    numbers: dict[str, float] = {}
    for k, body in enumerate(mechanism.bodies):
        inertia = np.asarray(body.inertia, dtype=np.float64)
        matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
        if not body.mass and not matrix.any():  # a frame
            bodies.append(body)
            continue
        center = {f"center{k}_{i}": float(value) for i, value in enumerate(np.asarray(body.center, dtype=np.float64))}
        entries = {f"inertia{k}_{i}{j}": float(matrix[i, j]) for i in range(3) for j in range(i, 3)}
        rows = [[f"inertia{k}_{min(i, j)}{max(i, j)}" for j in range(3)] for i in range(3)]
        numbers |= {f"mass{k}": float(np.asarray(body.mass)), **center, **entries}
        bodies.append(replace(body, mass=f"mass{k}", center=tuple(center), inertia=rows))
    return replace(mechanism, bodies=bodies, parameters=numbers), numbers
