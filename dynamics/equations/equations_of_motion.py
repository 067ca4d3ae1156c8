"""Equations of motion as graphs: energies, mass matrix, bias, Coriolis matrix, gravity, momentum, forward dynamics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cgraph import Graph, Node
from cgraph._shared import require_choice, require_flag
from cgraph.extend import Builder, building, cotangents, folded, topological

from ..systems.kinematics import ONE, ZERO, changes, dot, substitute
from ..systems.model import Model, as_system
from ..systems.system import System
from .bias_terms import bias_terms, bias_terms_of_lagrangian
from .equation import Equation, Output, called, entries, mirrored, shortened
from .mass_matrix.accelerations import accelerations, inverse, mass_solve, smaller_solution

FEW_COORDINATES = 2  # coordinates up to which a bias is also derived from the Lagrangian
INERTIA, FORCE = "kg m^2, kg m or kg", "N m or N"


@Equation("q qd", Output("E", (), "J"))
def energy(system: System) -> Iterator[list[Node]]:
    """Total energy E = qd . dL/dqd - L, which is K + P for a kinetic energy quadratic in qd.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'E': 4.0}
    """
    build = Builder()
    momenta = cotangents({system.lagrangian: ONE}, system.qd, build)
    with building(build):
        yield [dot(momenta, system.qd) - system.lagrangian]


@Equation("q qd", Output("K", (), "J"))
def kinetic_energy(system: System) -> Iterator[list[Node]]:
    """The kinetic energy K: terms of L tagged "kinetic"; without tags what motion adds to the energy, K = E - P.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.kinetic_energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'K': 2.0}
    """
    yield [system.energies.kinetic]


@Equation("q qd", Output("P", (), "J"))
def potential_energy(system: System) -> Iterator[list[Node]]:
    """The potential energy P: terms of L tagged "potential"; without tags the energy at rest, P = -L at qd = 0.

    Returns
    -------
    Of bodies P is 0 where all of them are at the world's origin, and springs at their reference.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.potential_energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'P': 2.0}
    """
    yield [system.energies.potential]


@Equation("q qd", Output("M_{}_{}", ("n", "n"), INERTIA))
def mass_matrix(system: System) -> Iterator[list[Node]]:
    """Mass matrix M(q) = d2L/dqd2, the part of tau that multiplies qdd.

    Returns
    -------
    M is symmetric, and depends on qd only for a Lagrangian that is not quadratic in it.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[3.0], lengths=[2.0])
    >>> dyn.mass_matrix(arm).evaluate({"q0": 0.1, "qd0": 0.0})
    {'M_0_0': 4.0}
    """
    yield entries(mirrored(system.mass_matrix(system.lagrangian)))


@Equation("q qd", Output("Minv_{}_{}", ("n", "n"), "1/(kg m^2), 1/(kg m) or 1/kg"))
def inverse_mass_matrix(system: System) -> Iterator[list[Node]]:
    """Inverse mass matrix M(q)^-1: what accelerations take of forces, d qdd / d tau.

    One factorization serves all columns, and only half of the symmetric entries is computed. Of a tree of bodies M^-1
    has no zeros: all that is connected moves. To solve with one right-hand side, `forward_dynamics` takes far less.
    Constraints are left out.

    Returns
    -------
    M^-1 is symmetric.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0, 1.0], lengths=[1.0, 1.0])
    >>> at = dyn.arrays_at(arm, dyn.inverse_mass_matrix(arm), q=[0.0, 1.5707963267948966])
    >>> at["Minv"].round(6).tolist()
    [[0.75, -0.75], [-0.75, 3.75]]
    """
    free, build = system.without_constraints, Builder()
    accelerations(free)  # raises where M is singular
    solve = smaller_solution(free, lambda method: mass_solve(free, build, method), lambda each: each.size(system.n))
    yield entries(inverse(solve, build))


@Equation("q qd", Output("bias{}", ("n",), FORCE))
def bias(system: System) -> Iterator[list[Node]]:
    """Coriolis, centrifugal and gravity force together: tau at qdd = 0 without damping and applied forces.

    tau + forces - damping * qd = M qdd + bias.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[2.0], gravity=9.81)
    >>> dyn.bias(arm).evaluate({"q0": 1.5707963267948966, "qd0": 3.0})
    {'bias0': 9.81}
    """
    free = system.without_constraints  # whose tags shared nodes would have
    yield bias_terms(free).bias(free, Builder())
    if system.n <= FEW_COORDINATES:  # of a joint or two the energy has no more than the bodies
        yield from [bias_terms_of_lagrangian(form).bias(free, Builder()) for form in free.forms]


@Equation("q qd", Output("gravity{}", ("n",), FORCE))
def gravity_force(system: System) -> Iterator[list[Node]]:
    """The bias at rest: dP/dq, from gravity and springs.

    Examples
    --------
    >>> import dynamics as dyn
    >>> print(dyn.gravity_force(dyn.planar_arm(masses=[1.0], lengths=[1.0])).listing(), end="")
    inputs q0 qd0
    %1 = sin q0  # adjoint; link 1, potential
    %2 = mul 4.905 %1  # primal; link 1, potential
    output gravity0 = %2
    """
    free = system.without_constraints
    for terms in [bias_terms_of_lagrangian(form) for form in free.forms] + [bias_terms(free)]:
        yield substitute(terms.bias(free, Builder()), dict.fromkeys(system.qd, ZERO))


@Equation("q qd", Output("p{}", ("n",), "kg m^2/s or kg m/s"))
def momentum(system: System) -> Iterator[list[Node]]:
    """Generalized momenta p = dL/dqd.

    Examples
    --------
    >>> import dynamics as dyn
    >>> block = dyn.System(lambda q, qd, t, p: 0.5 * p["m"] * qd[0] ** 2, ["x"], {"m": 2.0})
    >>> dyn.momentum(block).evaluate({"q0": 0.0, "qd0": 3.0, "m": 2.0})
    {'p0': 6.0}
    """
    for form in system.forms:
        yield cotangents({form.lagrangian: ONE}, system.qd)


@Equation("q qd", Output("damping{}", ("n",), FORCE), rewritten=False)
def damping_force(system: System) -> Iterator[list[Node]]:
    """The force that viscous damping takes, D qd.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm(masses=[1.0], lengths=[1.0], damping=0.5)
    >>> dyn.damping_force(arm).evaluate({"q0": 0.0, "qd0": 3.0})
    {'damping0': 1.5}
    """
    yield system.braking(Builder())


SOLUTIONS = ("auto", "recursive", "dense", "balanced")


@Equation("q qd tau", Output("qdd{}", ("n",), "rad/s^2 or m/s^2")).describes
def forward_dynamics(model: Model, method: str = "auto", *, check: bool = False) -> Graph:
    """Accelerations: qdd = M^-1 (tau + forces - damping * qd - bias), from the Lagrangian.

    A mechanism states its bias itself; of others it is derived.

    Parameters
    ----------
    method : {"auto", "recursive", "dense", "balanced"}
        "recursive": elimination on the graph of L without forming M (`cg.hessian_solve`); for a tree of bodies the
        number of nodes is linear in n. "dense": M factored as LDL^T; smaller for some short arms, and less accurate
        where masses or lengths differ by decades. "auto": recursive, but up to 7 coordinates dense where that saves
        more than a tenth of the nodes. "balanced": elimination of halves of a chain at the same time, so that of
        the depth of a planar chain about an operation a link is left, for up to twice the nodes (`cg.hessian_solve`);
        not with constraints.
    check : bool
        One more output, `info`: 0 where M is positive definite, else 1 + the index of the coordinate whose inertia
        is zero or negative after elimination; the accelerations mean nothing there. `raise_if_singular` raises on it.
        Three nodes a coordinate. Beyond the coordinates it counts the independent constraints: that one says nothing
        new at this state. Not by "dense" where there are constraints. Without `check`, the result where M is singular
        is infinite, NaN or meaningless.

    Returns
    -------
    With constraints then lambda0.., (m,): M qdd = tau + forces - damping * qd - bias + J^T lambda, for the rows J of
    all constraints. Those that follow from others are left out, with a warning that names them; theirs are 0.

    Raises
    ------
    ConstraintError
        No state was seen that meets the constraints, or they hold a direction without inertia.
    SingularMassMatrixError
        M is singular at every state, or with `check` not positive definite at any; the message names the coordinates.
        An indefinite M that is regular is solved with.
    ValueError
        For an unknown method, or one that takes no constraints.

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
    system = as_system(model)
    if check and method == "dense" and len(system.constraints):
        raise ValueError('check needs method="recursive" or "auto" where there are constraints, got "dense"')
    if method == "balanced" and len(system.constraints):  # whose multipliers have no place in that order
        name = system.constraints.names[0]
        raise ValueError(f'method "balanced" needs a system without constraints, got constraint {name!r}')
    return called(shortened(system, lambda form: accelerations(form, method, check)), model)


@Equation("q qd", Output("C_{}_{}", ("n", "n"), "N m s, N s or N s/m"), rewritten=False)
def coriolis(system: System) -> Iterator[list[Node]]:
    """Coriolis matrix C(q, qd) with C qd + gravity_force = bias and dM/dt - 2 C skew.

    The Coriolis force is quadratic in qd with Christoffel's symbols as coefficients, c_i = sum_jk Gamma_ijk qd_j qd_k,
    and these are symmetric in j and k. So C = (d bias / d qd) / 2: one forward sweep a column over the graph of the
    bias. Forces linear in qd (gyroscopic, magnetic) would be halved by that; they count in full, and being skew they
    leave dM/dt - 2 C skew. Where L depends on t, so do they, and dM/dt - 2 C is skew less twice dM/dt at fixed q.
    Quasi-velocities bring the brackets of their columns, C = (d bias / d qd) / 2 - M c(qd, .) / 2, without which
    dM/dt - 2 C would not be skew.

    Raises
    ------
    ValueError
        For an L that is not quadratic in the velocities.

    Examples
    --------
    >>> import dynamics as dyn
    >>> slider = dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2), ["r", "theta"])
    >>> dyn.coriolis(slider).evaluate({"q0": 2.0, "q1": 0.0, "qd0": 3.0, "qd1": 5.0})
    {'C_0_0': 0.0, 'C_0_1': -10.0, 'C_1_0': 10.0, 'C_1_1': 6.0}
    """
    require_quadratic(system)
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], Builder())
    mass = [] if system.kinematics.quasi is None else system.mass_matrix(lagrangian, build)
    yield entries(coriolis_matrix(system, folded(bias(system).outputs.values(), build), build, mass))


def coriolis_matrix(
    system: System, forces: list[Node], build: Builder, mass: Sequence[Sequence[Node]]
) -> list[list[Node]]:
    """Rows of C from the nodes of the bias, b(q, qd) = c(q, qd) + G(q) qd + g(q), c of degree two in qd.

    mass: the lower triangle of M, which quasi-velocities need.

    db/dqd = dc/dqd + G, and at qd = 0 it is G. By Euler's theorem dc/dqd qd = 2 c, so C = (dc/dqd) / 2 + G, which is
    (db/dqd + db/dqd at qd = 0) / 2.
    """
    n = system.n
    columns = [changes({velocity: ONE}, forces, build) for velocity in system.qd]  # one sweep gives db/dqd_j
    partials = list(zip(*columns, strict=True))  # db/dqd
    linear = folded(substitute(entries(partials), dict.fromkeys(system.qd, ZERO)), build)  # G
    with building(build):
        halves = [0.5 * (a + b) for a, b in zip(entries(partials), linear, strict=True)]
    rows = [halves[i * n : (i + 1) * n] for i in range(n)]
    if system.kinematics.quasi is None:
        return rows
    brackets, whole = system.kinematics.brackets(build), mirrored(mass)
    with building(build):  # - M c(qd, .) / 2
        for i in range(n):
            for j in range(n):
                taken = sum([whole[i][k] * brackets[k][j] for k in range(n)], ZERO)
                rows[i][j] = rows[i][j] - 0.5 * taken
    return rows


def require_quadratic(system: System) -> None:
    """Raises ValueError unless L is quadratic in the velocities, that is, M does not depend on them."""
    (lagrangian,) = folded([system.lagrangian], Builder())
    reached = set(topological(entries(system.mass_matrix(lagrangian))))
    for name, velocity in zip(system.velocities, system.qd, strict=True):
        if velocity in reached:
            raise ValueError(
                "the Lagrangian must be quadratic in the velocities, "
                f"its mass matrix depends on that of {name!r} ({velocity.name})"
            )
