"""Base parameters of a mechanism: the combinations of inertial parameters that its motion can show, and no more.

A column of the regressor that depends on those before it, at many states at once, belongs to a parameter that cannot be
told from theirs: it is added to them. So a body's numbers go to the bodies that carry it, as far as can be.
(M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8(4), 1991.)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cgraph._shared import Array

from ...equations.states.initial_value import normalized
from ...systems.model import Model
from ..trees.mechanism import require_mechanism
from .body_quantity import of_bodies
from .regressor import PARAMETERS, regressor

SAMPLES = 60  # random states: 60 n rows for 10 n columns
ROUNDING = 1e-9  # of a column's length, what is left of it beside those that it depends on
Columns = np.ndarray[tuple[int], np.dtype[np.intp]]


class BaseParameters(NamedTuple):
    """The combinations beta of inertial parameters pi that motion shows: Y pi = Y[:, columns] beta, beta = grouping pi.

    Parameters
    ----------
    names : tuple of str
        Of each combination, the parameter that stands for it: "Iyy of link 1".
    columns : ndarray of int, (rank,)
        Its place among all, and that of its column in the regressor.
    grouping : ndarray, (rank, 10 n)
        What of all parameters is in each combination: 1 at its own place, 0 at those of the others'.

    Examples
    --------
    >>> import dynamics as dyn
    >>> base = dyn.base_parameters(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]))
    >>> base.rank, base.names[:3]
    (6, ('mx of link 1', 'mz of link 1', 'Iyy of link 1'))
    >>> base.grouping[2, [6, 10]].round(9).tolist()  # in Iyy of link 1 are its own, and the second mass at 1 m
    [1.0, 1.0]
    """

    names: tuple[str, ...]
    columns: Columns
    grouping: Array

    @property
    def rank(self) -> int:
        """Number of combinations."""
        return len(self.names)


@of_bodies
def base_parameters(model: Model) -> BaseParameters:
    """The combinations of inertial parameters that motion shows, see `regressor`: the base parameters.

    Each stands at the body nearest the world that can have it. They depend on joints, their places and gravity alone,
    and are found at random states, of coordinates, velocities and accelerations of about 1, where a dependence to 1e-9
    is one. A matrix that is measured takes them as it takes those of all: `y[:, base.columns]`.

    Returns
    -------
    BaseParameters
        names, columns and grouping of as many as there are, `rank`.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.base_parameters(dyn.planar_arm([1.0], [1.0])).names
    ('mx of link 1', 'mz of link 1', 'Iyy of link 1')
    """
    mechanism = require_mechanism(model, "base_parameters").bind()
    graph, system = regressor(mechanism), mechanism.system
    drawn = np.random.default_rng(0).normal(size=(SAMPLES, len(graph.inputs)))
    drawn[:, : system.nq] = normalized(mechanism, drawn[:, : system.nq + system.n])[:, : system.nq]
    values = graph.evaluate(dict(zip(graph.input_names, drawn.T, strict=True))).values()
    table = np.stack([np.broadcast_to(column, SAMPLES) for column in values], axis=1)
    matrix = table.astype(np.float64).reshape(SAMPLES * system.n, -1)  # the regressors, one below the other
    lengths = np.linalg.norm(matrix, axis=0)
    shown = np.flatnonzero(lengths > 0.0)
    unit = matrix[:, shown] / lengths[shown]
    kept, directions = [], np.empty((len(unit), 0))
    for k, column in enumerate(unit.T):
        rest = column
        for _ in range(2):  # twice is enough for directions at right angles to all digits
            rest = rest - directions @ (directions.T @ rest)
        if (length := float(np.linalg.norm(rest))) > ROUNDING:
            kept.append(k)
            directions = np.column_stack([directions, rest / length])
    columns, grouping = shown[kept], np.zeros((len(kept), matrix.shape[1]))
    shares = np.linalg.solve(directions.T @ unit[:, kept], directions.T @ unit)
    shares[:, kept] = np.eye(len(kept))
    shares[np.abs(shares) <= ROUNDING] = 0.0
    grouping[:, shown] = shares * lengths[shown] / lengths[columns][:, None]
    names = [f"{PARAMETERS[k % 10]} of {mechanism.moving[k // 10].name}" for k in columns.tolist()]
    return BaseParameters(tuple(names), columns, grouping)
