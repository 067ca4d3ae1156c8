"""The rank of constraints: which rows say something new, looked for at states that meet them, free of units."""

from __future__ import annotations

import warnings

import numpy as np

from cgraph.extend import Array, kept_by_first

from ..systems.constraints import Constraints
from .row_numbers import row_numbers

STATES = 8  # states that meet the constraints and whose rank is clear, at which rows are compared, at most
DEPENDENT = 1e-9  # of the largest row of a loop, or of a row of no loop: one of the others if no more of it is left
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
    """Indices of the rows that do not follow from those before them, at all states seen.

    The states are random ones that meet the constraints, since rows may depend on one another only there. Where the
    rank is less than elsewhere, a state that is known to the rounding e of the rows is off by sqrt(e), and so are rows
    that follow from others: states at which as little of a row is new count only if no others are seen. What is new is
    measured by the size of the row, or of the largest of its loop, about the state. Warns of that, and of rows that are
    left out, unless they hold nothing, as the third of a point in a plane.

    Raises ConstraintError where no state is seen that meets all.
    """
    numbers = row_numbers(constraints)
    clear: list[dict[int, float]] = []
    doubtful: list[dict[int, float]] = []
    acting = np.zeros(len(constraints), dtype=bool)
    for point in numbers.states():
        matrix = numbers.certain_matrix(point)
        acting |= matrix.any(axis=1)
        shares = _independent(matrix, *numbers.scales(point))
        if min(shares.values(), default=1.0) < CLEAR:
            doubtful.append(shares)
            continue
        clear.append(shares)
        if len(clear) == STATES or len(shares) == np.count_nonzero(numbers.typical(point, numbers.reach).any(axis=1)):
            break
    kept = max(clear or doubtful, key=len)
    small = [f"{constraints.names[k]!r} ({x:.1e} of it is new)" for k, x in kept.items() if x < CLEAR]
    if small and not clear:
        text = f"at all states seen next to nothing is new of {' and '.join(small)}: kept, and may hold the motion"
        warnings.warn(text, ConstraintWarning, stacklevel=2)
    dropped = [name for k, name in enumerate(constraints.names) if k not in kept and acting[k]]
    if dropped:
        names = " and ".join(map(repr, dropped))
        one = len(dropped) == 1
        verbs = "follows from the others and is" if one else "follow from the others and are"
        text = f"constraint{'' if one else 's'} {names} {verbs} left out"
        warnings.warn(text, ConstraintWarning, stacklevel=2)
    return tuple(kept)


def _independent(matrix: Array, rows: Array, columns: Array) -> dict[int, float]:
    """Rows of J that are not sums of earlier ones, and how much of each is new: Gram and Schmidt.

    rows, columns: factors by what J is about the state; by what it is there a row that is small at a flat position
    would look as good as any.
    """
    kept: dict[int, float] = {}
    basis: list[Array] = []
    for k, rest in enumerate(rows[:, None] * matrix * columns):
        for _ in range(2):
            for unit in basis:
                rest = rest - (unit @ rest) * unit
        if (left := float(np.linalg.norm(rest))) > DEPENDENT:
            kept[k] = left
            basis.append(rest / left)
    return kept
