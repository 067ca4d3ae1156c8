"""The rank of constraints: which rows say something new, looked for at states that meet them, free of units.

An axis that is tilted by 1e-13 rad makes of a linkage in a plane one in space, whose rows across the plane have
entries of that size alone, and hold it still. Scaled by itself such a row is as good as any; beside the others of its
loop it is seen to be no more than the rounding of numbers in a file: it nearly follows from them.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from cgraph._shared import Array, kept_by_first

from ...systems.constraints import ConstraintError, Constraints
from .row_numbers import RowNumbers, factors, row_numbers

STATES = 16  # states that meet the constraints and whose rank is clear, at which rows are compared, at most
SEEN = 5  # of these, about which rows that follow are looked at
DEPENDENT = 1e-9  # of the largest row of a loop, or of a row of no loop: one of the others if no more of it is left
BETTER = 5.0  # times as much of it has to be new for a row to be kept in place of one before it
CLEAR = 1e-5  # what is left of rows that are independent: less is also seen where a state is singular but for rounding
NAMED = 1e-2  # of the largest row of its loop: a row of which no more is left is named, though it is kept
STARTS, CLOSEST = 12, 6  # of least squares for states of loops that are nearly closed; of these the best
OPEN, WORSE = 1e-1, 30.0  # of a loop, at most, once it has arrived; and of the state that closes best
EXACT = 1e-12  # of a row that is a sum of others but for the rounding of axes and lengths
ALIKE = 0.5  # of the largest row: one that is as good


class ConstraintWarning(UserWarning):
    """Constraints that say nothing new, and a start that had to be moved to meet them.

    Examples
    --------
    >>> import warnings
    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2)
    >>> twice = dyn.System(energy, "x y", constraints=lambda q, t: {"row": q[0] - q[1], "again": 2.0 * (q[0] - q[1])})
    >>> with warnings.catch_warnings(record=True) as noted:
    ...     warnings.simplefilter("always")
    ...     accelerations = dyn.forward_dynamics(twice)
    >>> print(noted[0].message)
    constraint 'again' follows from the others and is left out
    """


@kept_by_first
def independent_rows(constraints: Constraints) -> tuple[int, ...]:
    """Indices of rows that do not follow from one another, at random states that meet the constraints.

    Of rows that could stand for one another those are kept of which most is new at the worst state, the first ones
    where there is no great difference. Near a state of less rank, known to a rounding e, rows are off by sqrt(e): such
    states count only if no others are seen. Warns of that, and of rows that are left out.
    Raises ConstraintError where no state is seen that meets all, and for a row of no loop that has no slope where it is
    met, such as a square.
    """
    if not len(constraints):
        return ()
    numbers = row_numbers(constraints)
    clear: dict[int, list[tuple[dict[str, float], Array]]] = {}  # by rank
    doubtful: list[dict[int, float]] = []
    acting, flat = np.zeros(len(constraints), dtype=bool), np.ones(len(constraints), dtype=bool)
    for point in numbers.states():
        matrix = numbers.certain_matrix(point)
        acting |= matrix.any(axis=1)
        flat &= numbers.flat(point, matrix)
        matrix = numbers.scaled(point, matrix)
        shares = _independent([matrix])
        if min(shares.values(), default=1.0) < max(CLEAR, 10.0 * np.sqrt(numbers.openings([point]).max(initial=0.0))):
            doubtful.append(shares)
            continue
        clear.setdefault(len(shares), []).append((point, matrix))
        most = np.count_nonzero(numbers.typical(point, numbers.reach).any(axis=1))
        if sum(map(len, clear.values())) == STATES or len(shares) == most:
            break
    for k in np.flatnonzero(flat):
        if constraints.names[k] not in constraints.loop_rows and constraints.whole is None:
            text = "wherever it is met its slopes are 0, too, as those of a square are: write the condition itself"
            raise ConstraintError(f"constraint {constraints.names[k]!r} cannot hold the motion: {text}")
    kept = doubted = max(doubtful, key=len, default={})
    if clear:
        points, matrices = zip(*clear[max(clear)], strict=True)
        kept = _independent(matrices, BETTER)
        if len(kept) < max(clear):  # other rows at other states
            kept = _independent(matrices[:1])
        others = doubted if len(doubted) > len(kept) else np.flatnonzero(acting).tolist()
        about = numbers.about(points[:SEEN], [*kept]) if len(kept) < len(constraints) else points[:1]
        opened = numbers.openings(about).min(axis=0)  # at some states they may close another way
        kept = dict.fromkeys(sorted({*kept, *[k for k in others if opened[k] > CLEAR]}), 1.0)
    small = [f"{constraints.names[k]!r} ({x:.1e} of it is new)" for k, x in kept.items() if x < CLEAR]
    if small and not clear:
        text = f"at all states seen next to nothing is new of {' and '.join(small)}: kept, and may hold the motion"
        warnings.warn(text, ConstraintWarning, stacklevel=2)
    dropped = [name for k, name in enumerate(constraints.names) if k not in kept and acting[k]]
    warn_that_they_follow([repr(name) for name in dropped], "left out")
    return tuple(kept)


def warn_that_they_follow(rows: Sequence[str], then: str, nearly: str = "") -> None:
    """A ConstraintWarning on rows, if there are any, that follow from others.  then: what is done about them."""
    one = len(rows) == 1
    verbs = "follows from the others and is" if one else "follow from the others and are"
    text = f"constraint{'' if one else 's'} {' and '.join(rows)} {nearly}{verbs} {then}"
    if rows:
        warnings.warn(text, ConstraintWarning, stacklevel=3)


def _independent(matrices: Sequence[Array], better: float = np.inf) -> dict[int, float]:
    """Rows that are not sums of others, and how much of each is new where that is least: Gram and Schmidt.

    matrices: J of some states, (m, n), with factors by what J is about the state.
    better: times as much has to be new of a row to take the place of one before it; None for the first rows.
    """
    kept: dict[int, float] = {}
    rest = np.array(matrices)  # (states, m, n)
    while True:
        new = np.linalg.norm(rest, axis=2).min(axis=0)
        new[list(kept)] = 0.0
        if not (new > DEPENDENT).any():
            return dict(sorted(kept.items()))
        k = int(np.argmax((new > DEPENDENT) & (new >= new.max() / better)))
        kept[k] = float(new[k])
        units = rest[:, k] / np.linalg.norm(rest[:, k], axis=1)[:, None]
        for _ in range(2):
            rest = rest - np.einsum("sm,sn->smn", np.einsum("smn,sn->sm", rest, units), units)


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
    return [each.point for each in best[:CLOSEST] if each.size <= WORSE * best[0].size + DEPENDENT]


def _unit(constraints: Constraints, k: int) -> str:
    row = constraints.loop_rows.get(constraints.names[k])
    return "" if row is None else " rad" if row.angle else " m"
