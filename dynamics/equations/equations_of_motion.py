"""Equations of motion as graphs: mass matrix, bias, momentum, and forward dynamics."""

from __future__ import annotations

from collections.abc import Sequence

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, cotangents, require_choice, require_flag

from ..systems.model import Model, as_system
from ..systems.system import System
from .accelerations import accelerations, mass_matrix_graph
from .bias_terms import bias_terms, bias_terms_of_lagrangian
from .constraints.constraints import require_no_constraints
from .formulations.formulations import ONE, ZERO
from .shorter_form import shorter_form
from .substitute import substitute

FEW = 2  # coordinates up to which a bias is also derived from the Lagrangian


def mass_matrix(model: Model) -> Graph:
    """M(q), the part of tau that multiplies qdd: M = d2L/dqd2.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.

    Returns
    -------
    Graph
        Inputs q0.., qd0.. (M depends on qd only for a Lagrangian that is not quadratic), t if needed, parameters.
        Outputs M_0_0, M_0_1, .. row by row, (n, n), symmetric [kg m^2, kg m or kg].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[3.0], lengths=[2.0])
    >>> dyn.mass_matrix(arm).evaluate({"q0": 0.1, "qd0": 0.0})
    {'M_0_0': 4.0}
    """
    return shorter_form(as_system(model), mass_matrix_graph)


def bias(model: Model) -> Graph:
    """Coriolis, centrifugal and gravity force together: tau at qdd = 0 without damping and applied forces.

    tau + forces - damping * qd = M qdd + bias.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; outputs bias0.., (n,) [N m or N].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[2.0], gravity=9.81)
    >>> dyn.bias(arm).evaluate({"q0": 1.5707963267948966, "qd0": 3.0})
    {'bias0': 9.81}
    """

    def derive(system: System) -> Graph:
        free = system.without_constraints  # whose tags shared nodes would have
        terms = [bias_terms(free)]
        if system.n <= FEW:  # of a joint or two the energy has no more than the bodies
            terms += [bias_terms_of_lagrangian(form) for form in free.forms]
        return _smallest_graph(
            [system.graph(_named("bias", each.bias(free, Builder())), system.q, system.qd) for each in terms]
        )

    return shorter_form(as_system(model), derive)


def gravity_force(model: Model) -> Graph:
    """The bias at rest: dP/dq, from gravity and springs.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; outputs gravity0.., (n,) [N m or N].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> print(dyn.gravity_force(dyn.planar_arm(masses=[1.0], lengths=[1.0])).listing(), end="")
    inputs q0 qd0
    %1 = sin q0  # adjoint; link 1, potential
    %2 = mul 4.905 %1  # primal; link 1, potential
    output gravity0 = %2
    """

    def derive(system: System) -> Graph:
        free, graphs = system.without_constraints, []
        for terms in [bias_terms_of_lagrangian(form) for form in free.forms] + [bias_terms(free)]:
            at_rest = substitute(terms.bias(free, Builder()), dict.fromkeys(system.qd, ZERO))
            graphs.append(system.graph(_named("gravity", at_rest), system.q, system.qd))
        return _smallest_graph(graphs)

    return shorter_form(as_system(model), derive)


def momentum(model: Model) -> Graph:
    """Generalized momenta p = dL/dqd.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; outputs p0.., (n,) [kg m^2/s or kg m/s].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t, p: 0.5 * p["m"] * qd[0] ** 2, ["x"], {"m": 2.0})
    >>> dyn.momentum(block).evaluate({"q0": 0.0, "qd0": 3.0, "m": 2.0})
    {'p0': 6.0}
    """

    def derive(system: System) -> Graph:
        momenta = [cotangents({form.lagrangian: ONE}, system.qd) for form in system.forms]
        return _smallest_graph([system.graph(_named("p", bars), system.q, system.qd) for bars in momenta])

    return shorter_form(as_system(model), derive)


def _named(name: str, nodes: Sequence[Node]) -> dict[str, Node]:
    """The nodes as outputs, numbered."""
    return {f"{name}{i}": node for i, node in enumerate(nodes)}


def _smallest_graph(graphs: Sequence[Graph]) -> Graph:
    """The one with the fewest nodes, simplified; of equal ones the first."""
    return min([cg.simplify(graph) for graph in graphs], key=lambda graph: len(graph.nodes))


SOLUTIONS = ("auto", "recursive", "dense", "balanced")


def forward_dynamics(model: Model, method: str = "auto", *, check: bool = False) -> Graph:
    """Accelerations: qdd = M^-1 (tau + forces - damping * qd - bias), from the Lagrangian.

    A mechanism states its bias itself (`System.bias_forces`); of others it is derived.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene with n coordinates.
    method : {"auto", "recursive", "dense", "balanced"}
        "recursive": elimination on the graph of L without forming M (`cg.hessian_solve`); for a tree of bodies the
        number of nodes is linear in n. "dense": M factored as LDL^T; smaller for some short arms, and less accurate
        where masses or lengths differ by decades. "auto": recursive, but up to 7 coordinates dense where that saves
        more than a tenth of the nodes. "balanced": elimination of halves of a chain at the same time, and long sums in
        blocks, so that of a planar chain the depth is O(log n), for about twice the nodes (`cg.hessian_solve`); not
        with constraints.
    check : bool
        One more output, `info`: 0 where M is positive definite, else 1 + the index of the coordinate whose inertia
        is zero or negative after elimination; the accelerations mean nothing there. `raise_if_singular` raises on it.
        Three nodes a coordinate. Beyond the coordinates it counts the independent constraints: that one says nothing
        new at this state. Not by "dense" where there are constraints. Without `check`, the result where M is singular
        is infinite, NaN or meaningless.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., tau0.., t if needed, parameters; outputs qdd0.., (n,) [rad/s^2 or m/s^2]. With constraints
        then lambda0.., (m,): M qdd = tau + forces - damping * qd - bias + J^T lambda, for the rows J of all
        constraints. Those that follow from others are left out, with a warning that names them; theirs are 0.

    Raises
    ------
    ConstraintError
        No state was seen that meets the constraints, or they hold a direction without inertia.
    SingularMassMatrixError
        M is singular at every state, or with `check` not positive definite at any; the message names the coordinates.
        An indefinite M that is regular is solved with.
    ValueError
        For an unknown method, or one that takes no constraints.
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2, ["x"], damping=0.5)
    >>> dyn.forward_dynamics(block).evaluate({"q0": 0.0, "qd0": 2.0, "tau0": 9.0})
    {'qdd0': 2.0}

    A mass of 1 kg at the end of a rod of 1 m, in x and y: the rod pulls with its weight, and holds it on its circle.

    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1]
    >>> rod = dyn.System(energy, "x y", constraints=lambda q, t: {"rod": 0.5 * (q[0] ** 2 + q[1] ** 2 - 1.0)})
    >>> at = {"q0": 0.0, "q1": -1.0, "qd0": 2.0, "qd1": 0.0, "tau0": 0.0, "tau1": 0.0}
    >>> dyn.forward_dynamics(rod).evaluate(at)
    {'qdd0': 0.0, 'qdd1': 4.0, 'lambda0': -13.81}
    """
    require_choice("method", method, SOLUTIONS)
    require_flag("check", check)
    if check and method == "dense" and len(as_system(model).constraints):
        raise ValueError('check needs method="recursive" or "auto" where there are constraints, got "dense"')
    if method == "balanced":
        require_no_constraints(as_system(model))
    return shorter_form(as_system(model), lambda system: accelerations(system, method, check))
