"""Consistent states, those that meet the constraints of a model, and the freedom that constraints leave at a state."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array, real_number

from ...systems.arguments import finite_time
from ...systems.model import Model, as_system
from ..constraints.constraint_rank import ConstraintWarning, left_at
from ..constraints.constraints import projected
from ..equation import documented
from .initial_value import given_state, parameter_values

MOVED = "the velocities do not meet the constraints and were moved onto them"
VELOCITY_ROUNDING = 1e-9  # of the largest velocity, those of angles and lengths by what they move


@documented
def consistent_state(
    model: Model, q: ArrayLike, qd: ArrayLike, t: float = 0.0, parameters: Mapping[str, float] | None = None
) -> tuple[Array, Array]:
    """The state that meets the constraints of a model and is near to (q, qd), in the metric of its mass matrix.

    Parameters
    ----------
    q, qd : array_like, (nq,) and (n,)
        Where to start.
    t : float
        Time [s], for constraints that depend on it.

    Returns
    -------
    tuple of ndarray
        q, (nq,), and qd, (n,); as they are of a state that meets the constraints to rounding.

    Warns
    -----
    ConstraintWarning
        Where a velocity is changed by more than rounding: what was given is not a motion that the constraints admit.

    Raises
    ------
    ConstraintError
        Where Newton's method does not arrive; the message names the constraint that is left open.
    ValueError
        For states of another shape.

    Examples
    --------
    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2)
    >>> rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0})
    >>> q, qd = dyn.consistent_state(rod, [3.0, 4.0], [0.64, -0.48])
    >>> q.round(12).tolist(), qd.round(12).tolist()
    ([0.6, 0.8], [0.64, -0.48])
    """
    system = as_system(model)
    before = given_state(system, q, qd)[system.nq :]
    place, velocity = nearest_state(system, q, qd, t, parameters)
    lengths = np.array([length or 1.0 for length in system.lengths[system.nq :]])  # 0 is no known length
    change = lengths * np.abs(velocity - before)
    sizes = lengths * np.maximum(np.abs(before), np.abs(velocity))
    if change.max(initial=0.0) > VELOCITY_ROUNDING * sizes.max(initial=0.0):
        k = int(change.argmax())
        text = f"velocity {system.velocities[k]!r} from {before[k]:.3g} to {velocity[k]:.3g}"
        warnings.warn(f"{MOVED}, the most {text}", ConstraintWarning, stacklevel=2)
    return place, velocity


def nearest_state(
    model: Model, q: ArrayLike, qd: ArrayLike, t: float = 0.0, parameters: Mapping[str, float] | None = None
) -> tuple[Array, Array]:
    """`consistent_state` of velocities that nobody chose, such as random ones: without a warning."""
    system = as_system(model)
    state = projected(system, given_state(system, q, qd), finite_time(t), parameter_values(system, parameters))
    return state[: system.nq], state[system.nq :]


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
