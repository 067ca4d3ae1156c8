"""Linearization at many states, in machine code: written out, or as the Jacobian of the state equation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph._shared import Array, kept_by_first, require_choice

from ...systems.model import Model, as_system
from ..equation import documented
from ..state_equation import FORMS
from ..states.evaluate import input_rows
from .linearization import linear_rows, matrices

_machine_code = kept_by_first(cg.compile)


@documented
def linearize_many(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike | None = None,
    *,
    form: str = "velocity",
    t: float = 0.0,
    parameters: Mapping[str, float] | None = None,
    threads: int | None = 1,
) -> tuple[Array, Array]:
    """`linearize` at N states, such as those of a horizon: machine code, made at the first call and kept.

    Of small systems, and of the momentum form, whose states are q and qd, too, it is `state_space`, all entries written
    out. Of larger ones it is the Jacobian of the compiled `forward_dynamics`, colored, by displacements, velocities and
    forces; it keeps the digits of long chains, too, whatever the condition of M. States lie side by side in vectors.
    The matrices of a state whose mass matrix is singular, or with a quaternion of length 0, have entries that are
    infinite or NaN.

    Parameters
    ----------
    q, qd, tau : array_like, (N, nq) and (N, n)
        Coordinates [rad or m], their velocities, and applied forces [N m or N]; one row is the same for all.
    threads : int, optional
        How many share the states; None: one for each core.

    Returns
    -------
    A : ndarray, (N, 2n, 2n)
    B : ndarray, (N, 2n, n)

    Raises
    ------
    ValueError, SingularMassMatrixError
        As for `linearize`; for arrays that are all of one state; for a number of threads below 1.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0], gravity=10.0)
    >>> A, B = dyn.linearize_many(arm, [[0.0], [3.141592653589793]], [[0.0], [0.0]])
    >>> A[:, 1, 0].round(12).tolist(), B.shape
    ([-15.0, 15.0], (2, 2, 1))
    """
    system = as_system(model)
    found, n = linear_rows(system, require_choice("form", form, FORMS)), system.n
    function = _machine_code(found.graph)
    values = input_rows(system, found.inputs, {"q": q, "qd": qd, "tau": tau}, t, parameters)
    if values.ndim != 2:
        raise ValueError("linearize_many takes rows of states, got one state; see linearize")
    if found.wrt:
        x = np.hstack([values, np.zeros((len(values), function.n_in - len(found.inputs)))])
        x = x[0] if len(x) == 1 else x  # of one the columns fill vectors, not the states
        rows = function.jacobian(x, wrt=found.wrt, threads=threads).reshape(-1, 2 * n, 3 * n)
    else:
        rows = np.empty((len(values), 2 * n, 3 * n))
        function.batch(values.T, threads, out=rows.reshape(-1, 6 * n * n)[:, found.above.size :].T)
    return matrices(rows, found)
