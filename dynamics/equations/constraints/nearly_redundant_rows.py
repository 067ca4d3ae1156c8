"""Nearly redundant rows of loops: what is left of each row without the others, beside the largest of its loop.

An axis that is tilted by 1e-13 rad makes of a linkage in a plane one in space, whose rows across the plane have
entries of that size alone, and hold it still. Scaled by itself such a row is as good as any; beside the others of its
loop it is seen to be no more than the rounding of numbers in a file.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...systems.constraints import ConstraintError, Constraints
from .constraint_rank import DEPENDENT, independent_rows, warn_that_they_follow
from .row_numbers import RowNumbers, equilibrated, factors, row_numbers

NAMED = 1e-2  # of the largest row of its loop: a row of which no more is left is named, though it is kept
STATES = 6
SPREADS = (1.0, 0.3, 3.0, 0.1, 2.0, 0.5, 1.5, 0.03)  # of random starts about the neutral coordinates
FAR_GAP = 1e3  # of the gap that a row was left out with
OPEN, WORSE = 1e-1, 30.0  # of a loop, at most, once it has arrived; and of the state that closes best
EXACT = 1e-12  # of a row that is a sum of others but for the rounding of axes and lengths
ALIKE = 0.5  # of the largest row: one that is as good


class Left(NamedTuple):
    """Rows that say something new, and for each of all what was left of it without those before."""

    kept: list[int]
    shares: Array  # (m,), of the largest row of its loop
    sizes: Array  # (m,), of the whole row, likewise


def left_without(constraints: Constraints, matrices: Sequence[Array], tolerance: float | None = None) -> Left:
    """Gram and Schmidt, at several states at once: rows of no loop first, then the largest of what is left.

    Of rows that are about as large the first. tolerance: in place of those of the loops.
    """
    names, looped = constraints.names, constraints.loop_rows
    scales = [factors(constraints, matrix) for matrix in matrices]
    rest = np.stack(
        [rows[:, None] * matrix * columns for (rows, columns), matrix in zip(scales, matrices, strict=True)]
    )
    of_loops = [looped[name].tolerance if name in looped else 0.0 for name in names]
    least = np.maximum(of_loops if tolerance is None else [tolerance] * len(names), DEPENDENT)
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


def left_at(constraints: Constraints, q: Array, t: float, parameters: Mapping[str, float], tolerance: float) -> Left:
    """`left_without` at one state."""
    if not len(constraints):
        return Left([], np.zeros(0), np.zeros(0))
    numbers = row_numbers(constraints)
    return left_without(constraints, [numbers.matrix(numbers.point(q, {"t": t, **parameters}))], tolerance)


def lost_rank(constraints: Constraints, q: Array, t: float, parameters: Mapping[str, float]) -> str:
    """Sentence on a state where rows depend on one another that are independent elsewhere; "" where they do not."""
    if not len(constraints) or not np.isfinite(q).all():
        return ""
    elsewhere, here = independent_rows(constraints), left_at(constraints, q, t, parameters, DEPENDENT).kept
    if len(here) >= len(elsewhere):
        return ""
    names = " and ".join([repr(constraints.names[k]) for k in elsewhere if k not in here])
    return (
        f"at this state the constraints are of rank {len(here)}, elsewhere of {len(elsewhere)}: {names} says nothing "
        "that the others do not say, and accelerations are not determined"
    )


def least_new(constraints: Constraints, q: Array, t: float, parameters: Mapping[str, float]) -> float:
    """New share at a state, of the row of which least is, of those a system is solved with; 0 if one follows."""
    rows, numbers = list(independent_rows(constraints)), row_numbers(constraints)
    matrix = numbers.matrix(numbers.point(q, {"t": t, **parameters}))
    matrix[np.setdiff1d(np.arange(len(matrix)), rows)] = 0.0
    kept, shares, _ = left_without(constraints, [matrix], DEPENDENT)
    return float(shares[kept].min()) if len(kept) == len(rows) else 0.0


def opened(constraints: Constraints, q: Array, t: float, parameters: Mapping[str, float]) -> str:
    """Sentence on rows that were left out and are far more open than where they were; "" where none is."""
    if constraints.whole is None:
        return ""
    numbers = row_numbers(constraints.whole)
    gaps, names = np.abs(numbers.gaps(numbers.point(q, {"t": t, **parameters}))), constraints.names
    most = FAR_GAP * max(constraints.left_out.values())
    open_rows = [k for k in constraints.left_out if k < len(gaps) and gaps[k] > most]
    rows = [f"{names[k]!r} by {gaps[k]:.1e}" for k in open_rows]
    return (
        f"constraints that nearly follow from the others and were left out are open: {', '.join(rows)}" if rows else ""
    )


def without_nearly_redundant(constraints: Constraints) -> Constraints:
    """The constraints with 0 for the rows of loops that nearly follow from others, with a warning that names them."""
    if not constraints.loop_rows:
        return constraints
    numbers = row_numbers(constraints)
    found = _nearly_closed(constraints, numbers)
    if not found:
        return constraints
    matrices = [numbers.certain_matrix(point) for point in found]
    kept, shares, sizes = left_without(constraints, matrices)
    names, exact = constraints.names, _following(matrices, kept)
    exact -= {k for k in exact if 0.0 < sizes[k] < NAMED}  # which others that are as small must not take in their place
    dropped = [k for k in range(len(constraints)) if k not in kept and k not in exact]
    close = [k for k in kept if names[k] in constraints.loop_rows and shares[k] < NAMED]
    gaps = _gaps(constraints, numbers, found, {*kept} - {*close}) if dropped or close else np.zeros(0)
    for rows, what in (
        (dropped, "left out; a smaller tolerance of the Loop keeps {}"),
        (close, "kept: {} may hold the motion"),
    ):
        listed = [
            f"{names[k]!r} ({shares[k]:.1e} of it is new, open by up to {gaps[k]:.1e}{_unit(constraints, k)})"
            for k in rows
        ]
        warn_that_they_follow(listed, what.format("it" if len(rows) == 1 else "them"), "nearly ")
    return constraints.without({k: float(gaps[k]) for k in dropped}) if dropped else constraints


def _gaps(constraints: Constraints, numbers: RowNumbers, found: list[dict[str, float]], closed: set[int]) -> Array:
    """Largest gap of each row, (m,), at random states where these are closed."""
    points, others = list(found), [k for k in range(len(constraints)) if k not in closed]
    with suppress(ConstraintError):
        points += RowNumbers(constraints.without(dict.fromkeys(others, 0.0))).states()
    gaps = np.max([np.abs(numbers.gaps(point)) for point in points], axis=0)
    return np.concatenate([gaps, np.zeros(len(constraints) - len(gaps))])


def _nearly_closed(constraints: Constraints, numbers: RowNumbers) -> list[dict[str, float]]:
    """Random states where all rows are 0 but for what nearly follows from others, those that close best.

    Near a place where a linkage is singular Newton's method may end with a gap that is not of its axes.
    """
    rng, found = np.random.default_rng(0), list[tuple[float, dict[str, float]]]()
    neutral = np.array(constraints.kinematics.neutral)
    for spread in SPREADS:
        q = neutral + spread * rng.uniform(-1.0, 1.0, numbers.nq)
        point = numbers.point(q, {"t": float(rng.uniform(0.3, 1.2)), **constraints.parameters})
        gap, point = numbers.nearly_closed(point)
        if gap < OPEN:
            found.append((gap, point))
    found.sort(key=lambda pair: pair[0])
    return [point for gap, point in found[:STATES] if gap <= WORSE * found[0][0] + DEPENDENT]


def _unit(constraints: Constraints, k: int) -> str:
    row = constraints.loop_rows.get(constraints.names[k])
    return "" if row is None else " rad" if row.angle else " m"


def _following(matrices: Sequence[Array], kept: Sequence[int]) -> set[int]:
    """The rows that are sums of those kept to rounding, each beside its own size: rows of 0 among them."""
    following = set(range(len(matrices[0]))) - {*kept}
    for matrix in matrices:
        alike = equilibrated(matrix)
        basis = np.linalg.qr(alike[list(kept)].T)[0] if kept else np.zeros((alike.shape[1], 0))
        rest = np.linalg.norm(alike - (alike @ basis) @ basis.T, axis=1)
        following &= set(np.flatnonzero(rest <= EXACT * np.linalg.norm(alike, axis=1)).tolist())
    return following
