"""Many values at once: what is not looked at is what the check of one takes, and sound values are not looked at."""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from dynamics.multibody.bodies.body import BODY_QUANTITIES, JOINT_QUANTITIES, MechanismWarning
from dynamics.multibody.trees.structure import SURELY, unsure
from tests.each_row import each_row

COUNT = 60
WHAT = {check: name for name, check in (BODY_QUANTITIES | JOINT_QUANTITIES).items()}


def turned(moments: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Symmetric matrices with these principal moments, (N, 3)."""
    turns = np.linalg.qr(rng.normal(size=(len(moments), 3, 3)))[0]
    matrices = turns @ (moments[:, :, None] * turns.transpose(0, 2, 1))
    return 0.5 * (matrices + matrices.transpose(0, 2, 1))


def bodies(rng: np.random.Generator) -> np.ndarray:
    """Principal moments of bodies, some of them flat or rods, in any unit."""
    a = rng.uniform(0.0, 1.0, (COUNT, 3)) * rng.integers(0, 2, (COUNT, 3))
    a[:, 0] += 0.1
    return (a.sum(axis=1, keepdims=True) - a) * 10.0 ** rng.uniform(-12.0, 12.0, (COUNT, 1))


def sound(shape: tuple[int, ...], rng: np.random.Generator, name: str) -> np.ndarray:
    if name == "inertia":
        return turned(bodies(rng), rng) if len(shape) == 2 else bodies(rng)
    return rng.uniform(0.0, 3.0, (COUNT, *shape))


CASES = [
    (check, shape)
    for check in SURELY
    for shape in {"inertia": [(3,), (3, 3)], "position": [(3,)]}.get(WHAT[check], [()])
]


@each_row(("check", "shape"), CASES)
def test_what_is_not_looked_at_is_taken(check: Callable[..., Any], shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    rows = sound(shape, rng, WHAT[check])
    assert unsure(check, rows) == [0]
    flat = rows.reshape(COUNT, -1)
    for k in range(1, COUNT):
        where = rng.integers(flat.shape[1])
        flat[k, where] = [np.nan, np.inf, -1.0, -flat[k, where], 1e3 * flat[k].max(), 1e308, flat[k, where]][k % 7]
    for k in set(range(COUNT)) - set(unsure(check, rows)):
        with warnings.catch_warnings(action="error", category=MechanismWarning):
            check("body 'rod': inertia", rows[k] if shape else rows[k].item())
