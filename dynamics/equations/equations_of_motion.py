"""Equations of motion as graphs: mass matrix, bias, momentum, and forward dynamics."""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph
from cgraph.extend import (
    Builder,
    Order,
    SingularError,
    building,
    cotangents,
    require_choice,
    require_flag,
)

from ..systems.constraints import ConstraintError
from ..systems.model import Model, as_system
from ..systems.system import System
from .bias_terms import BiasTerms, bias_terms, bias_terms_of_lagrangian
from .constraints import (
    DenseSolver,
    constraint_rows,
    multiplier_outputs,
    require_no_constraints,
    solved_by_elimination,
    unknown_names,
)
from .formulations import ONE, ZERO
from .inertia_rank import without_inertia
from .shorter_form import shorter_form
from .singular_mass_matrix import SingularMassMatrixError, no_inertia
from .substitute import substitute


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

    def derive(system: System) -> Graph:
        lower, n = system.mass_matrix(system.lagrangian), system.n
        outputs = {f"M_{i}_{j}": lower[max(i, j)][min(i, j)] for i in range(n) for j in range(n)}
        return cg.simplify(system.graph(outputs, system.q, system.qd))

    return shorter_form(as_system(model), derive)


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
        outputs = {f"bias{i}": node for i, node in enumerate(bias_terms(free).bias(free, Builder()))}
        return cg.simplify(system.graph(outputs, system.q, system.qd))

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
        derived = bias_terms_of_lagrangian(system.without_constraints).bias(system, Builder())
        at_rest = substitute(derived, dict.fromkeys(system.qd, ZERO))
        return cg.simplify(system.graph({f"gravity{i}": node for i, node in enumerate(at_rest)}, system.q, system.qd))

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
        bars = cotangents({system.lagrangian: ONE}, system.qd)
        return cg.simplify(system.graph({f"p{i}": bar for i, bar in enumerate(bars)}, system.q, system.qd))

    return shorter_form(as_system(model), derive)


SOLUTIONS = ("auto", "recursive", "dense", "balanced")
DENSE_UP_TO = 7  # coordinates; beyond, the dense graph is larger on a tree of bodies, and takes long to build
WORTH = 0.9  # of the recursive graph's nodes, at most, for the dense one: elimination keeps more digits


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


def require_inertia(system: System, accelerations: Graph) -> None:
    """Raises SingularMassMatrixError where M is singular at every state, though no pivot is the constant zero."""
    moving = without_inertia(accelerations, lambda: mass_matrix(system), system.n)
    if moving:
        names = " and ".join([repr(system.velocities[i]) for i in moving])
        raise SingularMassMatrixError(
            f"the mass matrix is singular at every state: {'a motion of ' * (len(moving) > 1)}{names} has no inertia"
        )


def _require_inertia_without_constraints(system: System) -> None:
    """A coordinate whose inertia is the constant zero may leave with a constraint; one that is rounding must not."""
    free = system.without_constraints
    try:
        graph = _solved(free, bias_terms(free), "recursive", check=False)
    except SingularError:
        return
    require_inertia(free, graph)


def accelerations(system: System, method: str = "auto", check: bool = False) -> Graph:
    """Forward dynamics from the Lagrangian as it is written, by one of `SOLUTIONS`.

    Raises SingularMassMatrixError, see `forward_dynamics`.
    """
    held = bool(len(system.constraints))
    short = system.n <= DENSE_UP_TO and not (held and check)
    methods = [method] if method != "auto" else ["recursive", "dense"] if short else ["recursive"]
    terms = bias_terms(system)
    graphs: list[Graph] = []
    for each in methods:  # the dense matrix may lose in its entries what elimination keeps
        try:
            graphs.append(_solved(system, terms, each, check))
        except SingularError as error:
            failure = error
    if not graphs and failure.index >= system.n:
        raise ConstraintError(
            f"the constraints are singular: {unknown_names(system)[failure.index]} does nothing, or holds a direction "
            "without inertia"
        ) from None
    if not graphs:
        raise SingularMassMatrixError(no_inertia(system, failure)) from None
    chosen = graphs[-1] if len(graphs[-1].nodes) < WORTH * len(graphs[0].nodes) else graphs[0]
    if not system.surely_regular:
        if held:
            _require_inertia_without_constraints(system)
        else:
            require_inertia(system, chosen)
    return chosen


def _solved(system: System, terms: BiasTerms, method: str, check: bool) -> Graph:
    """M qdd - J^T lambda = tau + forces - D qd - bias, J qdd = -(dJ/dt) qd, solved by one method."""
    build = Builder()
    rows = constraint_rows(system, terms.rates)
    with building(build):
        # What stands at the coordinates already. Elimination takes the inertial terms where they are, at their
        # velocity nodes, and carries them to the coordinates on its way; a dense solve needs the whole bias here.
        at_rest = terms.gradient if method != "dense" else [-force for force in terms.bias(system, build)]
        with cg.tag("damping"):
            braking = [damping * qd for damping, qd in zip(system.damping, system.qd, strict=True)]
        rhs = [
            tau + force - brake + applied
            for tau, force, brake, applied in zip(system.tau, at_rest, braking, terms.forces, strict=True)
        ]
        inertial = {velocity: -force for velocity, force in terms.inertial.items()}
        rhs += [-change for change in system.constraints.rate_changes(rows.rates, build)]
    if method != "dense":
        order: Order = "balanced" if method == "balanced" else "recursive"
        solved = solved_by_elimination(system, terms, rows, rhs, inertial, build, check, order)
    else:
        solved = DenseSolver(system, terms.lagrangian, rows, build).solve(rhs, check)
    end = system.n + len(rows.kept)
    outputs = {f"qdd{i}": node for i, node in enumerate(solved[: system.n])}
    outputs |= multiplier_outputs(system, rows, solved[system.n : end], build)
    outputs |= dict(zip(("info",), solved[end:], strict=False))
    graph = cg.simplify(system.graph(outputs, system.q, system.qd, system.tau))
    return cg.balanced_sums(graph) if method == "balanced" else graph
