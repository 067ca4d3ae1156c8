"""Consistent states: those that meet the constraints of a model."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from cgraph._shared import Array

from ...systems.arguments import finite_time
from ...systems.model import Model, as_system
from ..constraints.constraint_rank import ConstraintWarning
from ..constraints.projection import projected
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
