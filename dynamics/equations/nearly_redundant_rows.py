"""Nearly redundant rows of loops: what is left of each row without the others, beside the largest of its loop.

An axis that is tilted by 1e-13 rad makes of a linkage in a plane one in space, whose rows across the plane have
entries of that size alone, and hold it still. Scaled by itself such a row is as good as any; beside the others of its
loop it is seen to be no more than the rounding of numbers in a file.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from ..systems.constraints import Constraints
from .constraint_rank import DEPENDENT, ConstraintWarning, RowNumbers, equilibrated

NAMED = 1e-2  # of the largest row of its loop: a row of which no more is left is named, though it is kept
STATES = 3
SPREADS = (1.0, 0.3, 3.0, 0.1, 0.03) * 3  # of random starts about the neutral coordinates
TRUNCATED = 2e-2  # of the largest singular value: what Newton's method does not close
OPEN = 1e-1  # of a loop, at most, once it has arrived
ALIKE = 0.5  # of the largest row: one that is as good
ITERATIONS, ARRIVED, LONGEST = 60, 1e-9, 0.5  # of Newton's method: steps, the last, and the longest, of displacements
ROUNDS = 4  # of scaling


class Left(NamedTuple):
    """Rows that say something new, and for each of all what was left of it without those before."""

    kept: list[int]
    shares: Array  # (m,), of the largest row of its loop
    sizes: Array  # (m,), of the whole row, likewise


def factors(constraints: Constraints, matrix: Array) -> tuple[Array, Array]:
    """Factors of rows, one for each loop, and of columns, which make J free of units and its largest entries 1.

    Rows of angles stand beside those of lengths by the longest lever that a joint of the loop has.
    """
    rows, columns = np.ones(len(matrix)), np.ones(matrix.shape[1])
    groups: dict[str, list[int]] = {}
    for k, name in enumerate(constraints.names):
        looped = constraints.loop_rows.get(name)
        groups.setdefault(name if looped is None else f"loop {looped.loop}", []).append(k)
        if looped and not looped.angle:
            rows[k] = -1.0  # a length
    for members in groups.values():
        lengths = [k for k in members if rows[k] < 0.0]
        lever = np.abs(matrix[lengths][:, constraints.turning]).max(initial=0.0)
        rows[lengths] = 1.0 / (lever or 1.0)
    for _ in range(ROUNDS):
        sizes = np.abs(rows[:, None] * matrix * columns).max(axis=0, initial=0.0)
        columns /= np.where(sizes > 0.0, sizes, 1.0)
        for members in groups.values():
            largest = np.linalg.norm(rows[members, None] * matrix[members] * columns, axis=1).max()
            rows[members] /= largest or 1.0
    return rows, columns


def left_without(constraints: Constraints, matrices: Sequence[Array], tolerance: float | None = None) -> Left:
    """Gram and Schmidt, at several states at once: rows of no loop first, then the largest of what is left.

    Of rows that are about as large the first. tolerance: in place of those of the loops.
    """
    names, looped = constraints.names, constraints.loop_rows
    scales = [factors(constraints, matrix) for matrix in matrices]
    rest = np.stack(
        [rows[:, None] * matrix * columns for (rows, columns), matrix in zip(scales, matrices, strict=True)]
    )
    least = np.array([looped[name].tolerance if name in looped else 0.0 for name in names])
    least = np.maximum(least if tolerance is None else tolerance, DEPENDENT)
    kept: list[int] = []
    shares = np.zeros(len(names))
    waiting = list(range(len(names)))
    whole = np.linalg.norm(rest, axis=2).max(axis=0)
    while True:
        sizes = np.linalg.norm(rest, axis=2)
        shares[waiting] = sizes.max(axis=0)[waiting]
        new = [k for k in waiting if shares[k] > least[k]]
        if not new:
            return Left(sorted(kept), shares, whole)
        among = [k for k in new if names[k] not in looped] or new
        typical = sizes.mean(axis=0)
        chosen = next(k for k in among if typical[k] >= ALIKE * typical[among].max())
        kept.append(chosen)
        waiting.remove(chosen)
        units = rest[:, chosen] / np.where(sizes[:, chosen] > 0.0, sizes[:, chosen], 1.0)[:, None]
        for _ in range(2):
            rest[:, waiting] -= (rest[:, waiting] @ units[:, :, None]) * units[:, None, :]


def without_nearly_redundant(constraints: Constraints) -> Constraints:
    """The constraints with 0 for the rows of loops that nearly follow from others, with a warning that names them."""
    if not constraints.loop_rows:
        return constraints
    numbers = RowNumbers(constraints)
    found = list(_nearly_closed(constraints, numbers))
    if not found:
        return constraints
    matrices = [numbers.certain_matrix(point) for point in found]
    kept, shares, sizes = left_without(constraints, matrices)
    gaps = np.max([np.abs(numbers.gaps(point)) for point in found], axis=0)
    gaps = np.concatenate([gaps, np.zeros(len(constraints) - len(gaps))])
    names, exact = constraints.names, _following(matrices, kept)
    exact -= {k for k in exact if 0.0 < sizes[k] < NAMED}  # which others that are as small must not take in their place
    dropped = [k for k in range(len(constraints)) if k not in kept and k not in exact]
    for what, rows in (
        ("left out; a smaller tolerance of the Loop keeps {}", dropped),
        ("kept: {} may hold the motion", [k for k in kept if names[k] in constraints.loop_rows and shares[k] < NAMED]),
    ):
        if rows:
            one = len(rows) == 1
            listed = " and ".join([f"{names[k]!r} ({shares[k]:.1e} of it is new, open by {gaps[k]:.1e}{_unit(constraints, k)})" for k in rows])
            verbs = "nearly follows from the others and is" if one else "nearly follow from the others and are"
            text = f"constraint{'' if one else 's'} {listed} {verbs} {what.format('it' if one else 'them')}"
            warnings.warn(text, ConstraintWarning, stacklevel=2)
    return constraints.without(dropped) if dropped else constraints


def _nearly_closed(constraints: Constraints, numbers: RowNumbers) -> Iterator[dict[str, float]]:
    """Random states where all rows are 0 but for what nearly follows from others: Newton's method without it."""
    rng, found = np.random.default_rng(0), 0
    neutral = np.array(constraints.kinematics.neutral)
    for spread in SPREADS:
        q = neutral + spread * rng.uniform(-1.0, 1.0, numbers.nq)
        point = numbers.point(q, {"t": float(rng.uniform(0.3, 1.2)), **constraints.parameters})
        with np.errstate(all="ignore"):
            for _ in range(ITERATIONS):
                phi, matrix = numbers.gaps(point), numbers.matrix(point)
                if not (np.isfinite(phi).all() and np.isfinite(matrix).all()):
                    break
                rows, columns = factors(constraints, matrix)
                left = rows[: len(phi)] * phi
                step = -np.linalg.lstsq((rows[:, None] * matrix * columns)[: len(phi)], left, rcond=TRUNCATED)[0]
                size = float(np.linalg.norm(step))
                if size < ARRIVED:
                    if np.abs(left).max(initial=0.0) < OPEN:
                        yield point
                        found += 1
                    break
                shorter = min(1.0, LONGEST / size)
                point = numbers.point(numbers.moved_by(point, shorter * columns * step), point)
        if found == STATES:
            return


def _unit(constraints: Constraints, k: int) -> str:
    row = constraints.loop_rows.get(constraints.names[k])
    return "" if row is None else " rad" if row.angle else " m"


def _following(matrices: Sequence[Array], kept: Sequence[int]) -> set[int]:
    """The rows that are sums of those kept, each beside its own size: rows of 0 among them."""
    following = set(range(len(matrices[0]))) - {*kept}
    for matrix in matrices:
        alike = equilibrated(matrix)
        basis = np.linalg.qr(alike[list(kept)].T)[0] if kept else np.zeros((alike.shape[1], 0))
        rest = np.linalg.norm(alike - (alike @ basis) @ basis.T, axis=1)
        following &= set(np.flatnonzero(rest <= DEPENDENT * np.linalg.norm(alike, axis=1)).tolist())
    return following
