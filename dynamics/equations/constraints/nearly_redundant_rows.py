"""Nearly redundant rows of loops: what is left of each row without the others, beside the largest of its loop.

An axis that is tilted by 1e-13 rad makes of a linkage in a plane one in space, whose rows across the plane have
entries of that size alone, and hold it still. Scaled by itself such a row is as good as any; beside the others of its
loop it is seen to be no more than the rounding of numbers in a file.
"""

from collections.abc import Mapping, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...systems.constraints import Constraints
from .constraint_rank import DEPENDENT, independent_rows, warn_that_they_follow
from .row_numbers import RowNumbers, factors, row_numbers

NAMED = 1e-2  # of the largest row of its loop: a row of which no more is left is named, though it is kept
STATES = 6
STARTS = 12  # of these
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
    numbers = row_numbers(constraints)
    scales = [numbers.scale or factors(matrix) for matrix in matrices]
    rest = np.stack(
        [rows[:, None] * matrix * columns for (rows, columns), matrix in zip(scales, matrices, strict=True)]
    )
    for members in numbers.groups:
        rest[:, members] /= np.linalg.norm(rest[:, members], axis=2).max() or 1.0
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
    """Sentence on rows that were left out and are open by more than the tolerance of their loop; "" where none is."""
    if constraints.whole is None:
        return ""
    whole, numbers = constraints.whole, row_numbers(constraints.whole)
    point = numbers.point(q, {"t": t, **parameters})
    gaps, (shares,) = np.abs(numbers.gaps(point)), numbers.openings([point])
    rows = [
        f"{whole.names[k]!r} by {gaps[k]:.1e}{_unit(whole, k)}"
        for k in constraints.left_out
        if shares[k] > whole.loop_rows[whole.names[k]].tolerance
    ]
    return (
        f"constraints that nearly follow from the others and were left out are open: {', '.join(rows)}" if rows else ""
    )


def without_nearly_redundant(constraints: Constraints) -> Constraints:
    """The constraints with 0 for the rows of loops that nearly follow from others, with a warning that names them.

    A row of which little is new, but which opens by more than the tolerance where the others are closed, is kept.
    """
    if not constraints.loop_rows:
        return constraints
    numbers = row_numbers(constraints)
    found = _nearly_closed(numbers)
    if not found:
        return constraints
    matrices = [numbers.certain_matrix(point) for point in found]
    kept, shares, sizes = left_without(constraints, matrices)
    names, looped = constraints.names, constraints.loop_rows
    tolerances = np.array([looped[name].tolerance if name in looped else np.inf for name in names])
    shares_open = numbers.openings(found)
    while len(kept) < len(names):
        shares_open = numbers.openings([*found, *numbers.about(found, kept)])
        over = np.median(shares_open[len(found) :], axis=0) - tolerances  # at some states they may close another way
        over[kept] = 0.0
        if not (over > 0.0).any():
            break
        kept = sorted([*kept, int(over.argmax())])
    gaps = shares_open[: len(found)].max(axis=0)  # rows that follow to rounding count, but for those that are as small
    exact = (shares <= EXACT) & (gaps <= DEPENDENT) & ((sizes == 0.0) | (sizes >= NAMED))
    dropped = [k for k in range(len(names)) if k not in kept and not exact[k]]
    close = [k for k in kept if names[k] in looped and shares[k] < NAMED]
    if close:  # but for those of which more is new where no row is closed: the states that were found are singular
        rng = np.random.default_rng(0)
        apart = [numbers.displaced(point, numbers.reach, rng) for point in found]
        there = left_without(constraints, [numbers.matrix(point) for point in apart]).shares
        close = [k for k in close if there[k] < 3.0 * NAMED]
    if dropped or close:
        others = numbers.closings(held=sorted({*kept} - {*close}))
        afar = numbers.openings([each.point for each in others if each.worst is None])
        shares_open = np.concatenate([shares_open, afar])
    within = np.where(shares_open > tolerances, 0.0, shares_open)
    within[:, close] = shares_open[:, close]
    gaps = within.max(axis=0) / (1.0 if numbers.scale is None else numbers.scale[0])
    for rows, what in (
        (dropped, "left out; a smaller tolerance of the Loop keeps {}"),
        (close, "kept: what is small may hold the motion"),
    ):
        listed = [
            f"{names[k]!r} ({shares[k]:.1e} of it is new, open by up to {gaps[k]:.1e}{_unit(constraints, k)})"
            for k in rows
        ]
        warn_that_they_follow(listed, what.format("it" if len(rows) == 1 else "them"), "nearly ")
    return constraints.without({k: float(gaps[k]) for k in dropped}) if dropped else constraints


def _nearly_closed(numbers: RowNumbers) -> list[dict[str, float]]:
    """States where all rows are 0 but for what nearly follows from others, those that close best, of the highest rank.

    Near a place where a linkage is singular, least squares may end with a gap that is not of its axes.
    """
    closings = [each for each in islice(numbers.closings(nearly=True), STARTS) if each.size < OPEN]
    closest = min([each.size for each in closings], default=0.0)
    tolerance = max(row.tolerance for row in numbers.constraints.loop_rows.values())
    closings = [each for each in closings if each.size <= max(WORSE * closest, tolerance, DEPENDENT)]
    ranks = [np.linalg.matrix_rank(numbers.scaled(each.point), tol=NAMED) for each in closings]
    best = [each for each, rank in zip(closings, ranks, strict=True) if rank == max(ranks)]
    best.sort(key=lambda each: each.size)
    return [each.point for each in best[:STATES] if each.size <= WORSE * best[0].size + DEPENDENT]


def _unit(constraints: Constraints, k: int) -> str:
    row = constraints.loop_rows.get(constraints.names[k])
    return "" if row is None else " rad" if row.angle else " m"
