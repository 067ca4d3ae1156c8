"""The error of a mass matrix that is singular, and the look at what a graph says of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cgraph.extend import SingularError, real_array

from ..systems.model import Model, as_system
from ..systems.system import System
from .constraints.constraints import unknown_names


class SingularMassMatrixError(ValueError):
    """A coordinate or a motion of several has no inertia, so that its acceleration is not determined.

    The message names the coordinates. `forward_dynamics` and what is made from it raise it where the mass matrix is
    singular at every state, `raise_if_singular` where it is singular at one.

    Examples
    --------
    >>> import dynamics as dyn
    >>> massless = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - q[0] * q[1], ["x", "y"])
    >>> try:
    ...     dyn.forward_dynamics(massless)
    ... except dyn.SingularMassMatrixError as error:
    ...     print(error)
    the mass matrix is singular: coordinate 'y' has no inertia, or none that others do not share
    """


def raise_if_singular(model: Model, info: ArrayLike) -> None:
    """Raise SingularMassMatrixError, naming the coordinate, unless the output `info` of `forward_dynamics` is 0.

    Parameters
    ----------
    model : Model
        The one that forward dynamics was made from.
    info : array_like
        A number, or an array of any shape; the first entry that is not 0 is reported, with its index.

    Raises
    ------
    SingularMassMatrixError
        An entry is not 0: the mass matrix is not positive definite at that state.

    Examples
    --------
    >>> import dynamics as dyn
    >>> bead = dyn.System(lambda q, qd, t: 0.5 * q[0] * qd[0] ** 2, ["x"])  # its inertia is x
    >>> values = dyn.forward_dynamics(bead, check=True).evaluate({"q0": -1.0, "qd0": 0.0, "tau0": 1.0})
    >>> try:
    ...     dyn.raise_if_singular(bead, values["info"])
    ... except dyn.SingularMassMatrixError as error:
    ...     print(error)
    the mass matrix is not positive definite: coordinate 'x' has an inertia that is not positive
    """
    values, names = real_array("info", info), unknown_names(as_system(model))
    failed = np.argwhere(values != 0.0)
    if len(failed):
        at = tuple(failed[0].tolist())
        if values[at] not in range(1, len(names) + 1):
            raise ValueError(f"info must be 0, or from 1 to {len(names)} for a coordinate, got {values[at]:g}")
        name = names[int(values[at]) - 1]
        where = f" at state {', '.join(map(str, at))}" if at else ""
        if name.startswith("constraint"):
            raise SingularMassMatrixError(f"the constraints are singular{where}: {name} follows from others")
        raise SingularMassMatrixError(
            f"the mass matrix is not positive definite{where}: {name} has an inertia that is not positive"
        )


def no_inertia(system: System, error: SingularError) -> str:
    """What a pivot that is not positive says of a coordinate."""
    name = system.velocities[error.index]
    if error.regular:
        return f"the mass matrix is not positive definite: coordinate {name!r} has an inertia that is not positive"
    return f"the mass matrix is singular: coordinate {name!r} has no inertia, or none that others do not share"
