"""Whether a mass matrix has full rank: motions without inertia, looked for at random states and free of units."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cgraph import Graph, extend
from cgraph.extend import Array

STATES = 3
TORQUE = 2.0**200  # so large that no other force counts
SPARE = 1e-3  # what rounding may do to M^-1, relative, where M is not looked at closely


def balanced(matrix: Array) -> Array:
    """s_i M_ij s_j with rows whose largest entries are about 1, for powers of two s: Ruiz's scaling, a few turns.

    matrix: (..., n, n), symmetric. A row of zeros stays.
    """
    scale = np.ones(matrix.shape[:-1])
    for _ in range(4):
        rows = np.abs(scale[..., :, None] * matrix * scale[..., None, :]).max(axis=-1)
        scale = scale * 2.0 ** -np.round(0.5 * np.log2(np.where(rows > 0.0, rows, 1.0)))
    return scale[..., :, None] * matrix * scale[..., None, :]


def without_inertia(accelerations: Graph, mass_matrix: Callable[[], Graph], n: int) -> list[int]:
    """The coordinates of which no digit of the acceleration is certain at some random states; [] where M has full rank.

    accelerations: the graph of forward dynamics. Its M^-1 mostly shows at once that there is nothing to fear. A pivot
    that is all rounding leaves no digit; one that is small, since a mass is, leaves them all.
    """
    rng = np.random.default_rng(0)
    found: set[int] = set()
    for k in range(STATES):
        point = {name: 10.0**-k * float(rng.uniform(0.5, 1.5)) for name in accelerations.input_names}
        point |= {f"tau{i}": TORQUE * point[f"tau{i}"] for i in range(n)}
        inverse = _inverse(accelerations, point, n)
        finite = np.isfinite(inverse).all(axis=1)
        if not finite.all():
            graph = mass_matrix()
            entries = graph.evaluate({name: point[name] for name in graph.input_names})
            inertia = np.array([*entries.values()], dtype=np.float64).reshape(n, n)
            if not np.isfinite(inertia).all():
                continue  # there is no M at this state
            if np.linalg.eigvalsh(balanced(inertia))[0] * SPARE > np.finfo(float).eps * n:
                return []  # it is a force that overflows
            found |= set(np.flatnonzero(~finite).tolist())  # a pivot is zero
            continue
        if np.linalg.cond(balanced(inverse), 1) * np.finfo(float).eps * n < SPARE:
            return []
        digits = extend.certain_digits(accelerations, point)
        lost = {i for i in range(n) if digits[f"qdd{i}"] == 0.0}
        if not lost:
            return []
        found |= lost
    return sorted(found)


def _inverse(accelerations: Graph, point: dict[str, float], n: int) -> Array:
    """M^-1 (n, n), from the accelerations at large torques on one coordinate at a time."""
    torques = {f"tau{i}": TORQUE * np.eye(n)[i] for i in range(n)}
    with np.errstate(all="ignore"):
        values = accelerations.evaluate(point | torques)
        return np.array([np.broadcast_to(values[f"qdd{i}"], n) for i in range(n)]) / TORQUE
