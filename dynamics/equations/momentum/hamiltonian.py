"""Hamilton's equations as graphs: the energy H(q, p), and the rates of coordinates and momenta."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Order, require_choice, require_flag, require_whole
from cgraph.extend import Builder, building, cotangents

from ...systems.kinematics import ONE, ZERO, dot
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import Equation, Output, called, shortened
from .legendre import Legendre

ITERATIONS = 40  # Newton's, for a Lagrangian that is not quadratic in the velocities


@Equation("q p", Output("H", (), "J")).describes
def hamiltonian(model: Model, *, iterations: int = ITERATIONS, check: bool = False) -> Graph:
    """The Hamiltonian H(q, p) = p . qd - L at the velocities of the momenta p = dL/dqd: the energy.

    Parameters
    ----------
    iterations, check
        As of `hamilton_equations`.

    Returns
    -------
    And missing0.. where asked for.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    ConstraintError
        For a model with constraints.
    ValueError
        For a parameter that is called like a momentum.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2 - 0.5 * q[0] ** 2, ["x"])
    >>> print(dyn.hamiltonian(spring).listing(), end="")
    inputs q0 p0
    %1 = mul p0 p0  # primal
    %2 = mul 0.125 %1  # primal
    %3 = mul q0 q0  # primal
    %4 = mul 0.5 %3  # primal
    %5 = add %2 %4  # primal
    output H = %5
    """
    count = require_whole("iterations", iterations, 1)
    require_flag("check", check)

    def derive(system: System) -> Graph:
        build = Builder()
        transform = Legendre(system, build, count)
        p, u = transform.p, transform.velocities
        if transform.quadratic:  # of L = u M u / 2 + b u + L0 it is (p - b) u / 2 - L0
            (rest,) = transform.at_rest([transform.lagrangian])
            with building(build):
                total = dot([momentum - b for momentum, b in zip(p, transform.offset, strict=True)], u)
                total = 0.5 * total - rest
        else:
            (rest,) = transform.at([transform.lagrangian])
            with building(build):
                total = dot(p, u) - rest
        outputs = {"H": total} | (_missing(transform) if check else {})
        return cg.simplify(system.graph(outputs, system.q, p))

    return called(shortened(as_system(model), derive), model)


@Equation("q p tau", Output("q{}_dot", ("nq",), "rad/s or m/s"), Output("p{}_dot", ("n",), "N m or N")).describes
def hamilton_equations(
    model: Model, method: str = "recursive", *, iterations: int = ITERATIONS, check: bool = False
) -> Graph:
    """Hamilton's equations: qd of the momenta, and their rates p_dot = dL/dq + tau + forces - damping * qd.

    dL/dq is taken at fixed velocities, and is -dH/dq. Of quasi-velocities u, whose momenta are p = dL/du, the rates
    are G^T dL/dq - ad(u; p), see `QuasiVelocities`. Bodies give them by composite momentum: no acceleration and no
    bias is in the graph.

    Parameters
    ----------
    method : {"recursive", "balanced"}
        How the velocities are solved for: "recursive", the fewest nodes, or "balanced", which takes more nodes and is
        less deep, see `cg.hessian_solve`.
    iterations : int
        Newton's steps to the velocities where L is not quadratic in them; a good part of the nodes for every one. They
        go downhill on L - p qd, from rest, and reach the velocities of an L that is strictly convex in them: the usual
        number for momenta of up to 1e6 times those at which L is no longer quadratic.
    check : bool
        Further outputs missing0.., (n,): p - dL/dqd at the velocities, what the iteration leaves of the momenta; 0
        where L is quadratic.

    Raises
    ------
    SingularMassMatrixError
        For a coordinate without inertia.
    ConstraintError
        For a model with constraints.
    ValueError
        For a parameter that is called like a momentum, or an unknown method.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * 4.0 * qd[0] ** 2 - 0.5 * q[0] ** 2, ["x"], damping=0.5)
    >>> dyn.hamilton_equations(spring).evaluate({"q0": 1.0, "p0": 8.0, "tau0": 0.0})
    {'q0_dot': 2.0, 'p0_dot': -2.0}
    """
    count = require_whole("iterations", iterations, 1)
    require_flag("check", check)
    order: Order = "balanced" if require_choice("method", method, get_args(Order)) == "balanced" else "recursive"
    return called(shortened(as_system(model), lambda system: _equations(system, count, check, order)), model)


def velocities(system: System) -> Graph:
    """The velocities qd0.. of momenta: inputs q0.., p0.., t if needed, parameters."""
    transform = Legendre(system, Builder(), ITERATIONS)
    outputs = {f"qd{i}": node for i, node in enumerate(transform.velocities)}
    return cg.simplify(system.graph(outputs, system.q, transform.p))


def missing_momenta(system: System) -> Graph | None:
    """Momenta that `velocities` do not reach, missing0.. as of `hamilton_equations`; None where nothing is iterated."""
    transform = Legendre(system, Builder(), ITERATIONS)
    return None if transform.quadratic else cg.simplify(system.graph(_missing(transform), system.q, transform.p))


def _equations(system: System, iterations: int, check: bool, order: Order) -> Graph:
    build = Builder()
    transform = Legendre(system, build, iterations, order)
    stated = momentum_slopes(system, transform.lagrangian, transform.p, build)
    braking = system.braking(build)
    with building(build):
        rates = [
            slope + tau + force - brake
            for slope, tau, force, brake in zip(stated, system.tau, system.forces, braking, strict=True)
        ]
    moved = transform.tagged(transform.at([*system.q_dot, *rates]))
    outputs = {f"q{i}_dot": node for i, node in enumerate(moved[: system.nq])}
    outputs |= {f"p{i}_dot": node for i, node in enumerate(moved[system.nq :])}
    if check:
        outputs |= _missing(transform)
    return cg.simplify(system.graph(outputs, system.q, transform.p, system.tau))


def momentum_slopes(system: System, lagrangian: Node, p: Sequence[Node], build: Builder) -> Sequence[Node]:
    """The rates of momenta p without forces, G^T dL/dq - ad(u; p).  lagrangian: folded."""
    terms = system.body_terms
    stated = None if terms is None else terms.equations.momentum_rates(system.q, system.qd, p)
    return stated or system.kinematics.slopes(cotangents({lagrangian: ONE}, system.q, build), p, build)


def _missing(transform: Legendre) -> dict[str, Node]:
    """Momenta that the iteration for the velocities does not reach, p - dL/dqd; 0 where there is none."""
    left = [ZERO] * transform.system.n
    if not transform.quadratic:
        here = transform.at(transform.momenta)
        with building(transform.build):
            left = [p - momentum for p, momentum in zip(transform.p, here, strict=True)]
    return {f"missing{i}": node for i, node in enumerate(left)}
