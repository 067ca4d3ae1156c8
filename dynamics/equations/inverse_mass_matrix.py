"""The inverse of the mass matrix as a graph."""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Builder

from ..systems.model import Model, as_system
from ..systems.system import System
from .accelerations import accelerations
from .mass_matrix_solve import inverse, mass_solve, shorter
from .shorter_form import shorter_form


def inverse_mass_matrix(model: Model) -> Graph:
    """M(q)^-1: what accelerations take of forces, d qdd / d tau.

    One factorization serves all columns, and only half of the symmetric entries is computed. Of a tree of bodies M^-1
    has no zeros: all that is connected moves. To solve with one right-hand side, `forward_dynamics` takes far less.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n velocities. Constraints are left out.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; outputs Minv_0_0, Minv_0_1, .. row by row, (n, n), symmetric.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> at = dyn.arrays_at(arm, dyn.inverse_mass_matrix(arm), q=[0.0, 1.5707963267948966])
    >>> at["Minv"].round(6).tolist()
    [[0.75, -0.75], [-0.75, 3.75]]
    """

    def derive(system: System) -> Graph:
        system, build = system.without_constraints, Builder()
        accelerations(system)  # raises where M is singular
        solve = shorter(system, lambda method: mass_solve(system, build, method))
        rows = inverse(solve, build)
        outputs = {f"Minv_{i}_{j}": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
        return cg.simplify(system.graph(outputs, system.q, system.qd))

    return shorter_form(as_system(model), derive)
