"""The rank of constraints: which rows say something new, looked for at states that meet them, free of units."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from cgraph._shared import Array, kept_by_first

from ...systems.constraints import ConstraintError, Constraints
from .row_numbers import row_numbers

STATES = 16  # states that meet the constraints and whose rank is clear, at which rows are compared, at most
SEEN = 5  # of these, about which rows that follow are looked at
DEPENDENT = 1e-9  # of the largest row of a loop, or of a row of no loop: one of the others if no more of it is left
BETTER = 5.0  # times as much of it has to be new for a row to be kept in place of one before it
CLEAR = 1e-5  # what is left of rows that are independent: less is also seen where a state is singular but for rounding


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
