"""The freedom of a model at a state: the rank of its constraints there, and which rows say nothing new."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import real_number

from ...systems.arguments import finite_time
from ...systems.model import Model, as_system
from ..constraints.nearly_redundant_rows import left_at
from ..equation import documented
from .initial_value import given_state, parameter_values

TOLERANCE = 2e-4  # as of a Loop


@dataclass(frozen=True)
class Freedom:
    """Freedoms that constraints leave a model at a state; see `freedom`.

    Parameters
    ----------
    rank : int
        How many rows of velocities say something new.
    redundant : tuple of str
        Names of the others.
    freedoms : int
        Velocities that are free, n - rank.
    tolerance : float
        How much of a row has to be new.
    shares : mapping of str to float
        {row: how much of it was new}, of the largest row of its loop, or of itself where it is of no loop.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.freedom(dyn.planar_arm([1.0, 1.0], [1.0, 1.0]), [0.0, 0.0]).freedoms
    2
    """

    rank: int
    redundant: tuple[str, ...]
    freedoms: int
    tolerance: float
    shares: Mapping[str, float]

    def __str__(self) -> str:
        """Sentence on the freedoms."""
        rows = ", ".join([f"{name!r} ({self.shares[name]:.1e} of it is new)" for name in self.redundant])
        rest = f"; redundant at tolerance {self.tolerance:g}: {rows}" if rows else ""
        return f"{self.freedoms} freedom(s): {len(self.shares)} constraint row(s) of rank {self.rank}{rest}"


@documented
def freedom(
    model: Model,
    q: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> Freedom:
    """The rank of a model's constraints at coordinates, its redundant rows, and the freedoms that are left.

    The rows of velocities, J, are scaled to be free of units, those of one loop alike, and taken in turn by Gram and
    Schmidt, the largest first. A row counts if more than `tolerance` is left of it. Rows that forward dynamics leaves
    out everywhere count as they are. The rank may be less here than elsewhere, as of a parallelogram that is flat:
    accelerations are not determined there.

    Parameters
    ----------
    q : array_like, (nq,)
        Coordinates [rad or m], which need not meet the constraints.
    tolerance : float
        From 0 to 1: what of a row, of the largest of its loop, is taken for rounding of lengths and axes.
    t : float
        Time [s], for constraints that depend on it.

    Returns
    -------
    Freedom

    Raises
    ------
    ValueError
        For coordinates of another shape, and a tolerance or a time that cannot be.

    Examples
    --------
    A mass in space on a rod, whose second row is the first again:

    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + qd[2] ** 2)
    >>> def rods(q, t):
    ...     square = q[0] ** 2 + q[1] ** 2 + q[2] ** 2
    ...     return {"rod": square - 1.0, "again": 3.0 - 3.0 * square}
    >>> print(dyn.freedom(dyn.System(energy, "x y z", constraints=rods), [1.0, 0.0, 0.0]))
    2 freedom(s): 2 constraint row(s) of rank 1; redundant at tolerance 0.0002: 'again' (0.0e+00 of it is new)
    """
    system, share, time = as_system(model), real_number("tolerance", tolerance), finite_time(t)
    if not 0.0 <= share < 1.0:
        raise ValueError(f"tolerance must be at least 0 and less than 1, got {tolerance!r}")
    x, values = given_state(system, q, np.zeros(system.n)), parameter_values(system, parameters)
    whole = system.constraints.whole or system.constraints
    kept, shares, _ = left_at(whole, x[: system.nq], time, values, share)
    redundant = tuple([name for k, name in enumerate(whole.names) if k not in kept])
    shown = dict(zip(whole.names, shares.tolist(), strict=True))
    return Freedom(len(kept), redundant, system.n - len(kept), share, shown)
