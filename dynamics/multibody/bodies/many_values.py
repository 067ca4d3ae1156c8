"""Many values of the numbers of bodies at once: which of them a check surely takes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cgraph._shared import Array

from .body import BODY_QUANTITIES, JOINT_QUANTITIES, moment_rounding

Flags = np.ndarray[Any, np.dtype[np.bool_]]
LARGEST = np.finfo(float).max / 4.0  # entry of an inertia, so that sums of moments are finite


def unsure(check: Callable[[str, object], Any], rows: Array) -> list[int]:
    """Which of many values, (N, ..), to look at one by one: the first, whose shape is that of all, and any in doubt."""
    surely = SURELY.get(check)
    if surely is None:  # a check of its own kind
        return list(range(len(rows)))
    flags = surely(rows)
    flags[:1] = False
    which: list[int] = np.flatnonzero(~flags).tolist()
    return which


def _finite(rows: Array) -> Flags:
    return np.asarray(np.isfinite(rows).reshape(len(rows), -1).all(axis=1))


def _not_negative(rows: Array) -> Flags:
    return np.asarray(_finite(rows) & (rows >= 0.0))


def _inertial(rows: Array) -> Flags:
    """Of inertias, (N, 3) or (N, 3, 3): symmetric, and with the moments of a body."""
    good = (np.abs(rows) < LARGEST).reshape(len(rows), -1).all(axis=1)
    if rows.ndim == 3:
        good &= (rows == rows.transpose(0, 2, 1)).all(axis=(1, 2))
    known = rows.copy()
    known[~good] = 0.0
    moments = np.linalg.eigvalsh(known) if rows.ndim == 3 else np.sort(known, axis=1)
    rounding = moment_rounding(1.0, 0.0) * np.abs(known).reshape(len(rows), -1).max(axis=1)
    flags: Flags = good & (moments[:, 0] >= -rounding) & (moments[:, 2] <= moments[:, 0] + moments[:, 1] + rounding)
    return flags


# For each check of a number, or of an array of them, which of many values it takes without a word.
SURELY: dict[Callable[[str, object], Any], Callable[[Array], Flags]] = {
    BODY_QUANTITIES["mass"]: _not_negative,
    BODY_QUANTITIES["center"]: _finite,
    BODY_QUANTITIES["inertia"]: _inertial,
    JOINT_QUANTITIES["damping"]: _not_negative,
    JOINT_QUANTITIES["spring_reference"]: _finite,
}
