"""Hamilton's equations as graphs: velocities of momenta, the energy H(q, p), and rates of coordinates and momenta."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple, get_args

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Order, require_choice, require_flag, require_whole, solve_tangents
from cgraph.extend import Builder, SingularError, building, cotangents, folded, topological

from ...systems.constraints import ConstraintError
from ...systems.kinematics import ONE, ZERO, dot
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import Equation, Output, called, shortened
from ..mass_matrix.singular_mass_matrix import SingularMassMatrixError, no_inertia, require_inertia

ITERATIONS = 40  # Newton's, for a Lagrangian that is not quadratic in the velocities
SHORTER_SHARE, LONGER_SHARE = 1.0 / 16.0, 2.0  # times the share of a step, after one too far and a good one
OVERSHOOT = 0.5  # of a slope at the start of a step, the other way at its end, and the step went too far
SETTLED = 1e-16  # step M step over u (p - b) where the step is 1e-8 of the velocities: the next one is rounding


class Legendre:
    """The velocities u of momenta p = dL/du at (q, p), solved for by elimination on the graph of L.

    Where L is quadratic in u, p = M u + b, they are M^-1 (p - b). Else Newton's method goes downhill in L(q, u) - p u
    from u = 0. Where the slope along a step has turned and is more than half as steep, or is not finite, a sixteenth of
    the step is tried; else twice the share is next, up to 1. No threshold has a unit.
    p: variables p0, p1, ...  lagrangian: L, folded.  quadratic: whether the solution does not depend on u.
    """

    def __init__(self, system: System, build: Builder, iterations: int, order: Order = "recursive") -> None:
        _require_canonical(system)
        self.system, self.build, self.iterations = system, build, iterations
        self.p = cg.variables([f"p{i}" for i in range(system.n)])
        (self.lagrangian,) = folded([system.lagrangian], build)
        self._at_rest: dict[Node, Node] = dict.fromkeys(system.qd, ZERO)
        try:
            solved = solve_tangents(self.lagrangian, system.qd, system.tau, build, order=order)
        except SingularError as error:
            raise SingularMassMatrixError(no_inertia(system, error)) from None
        solution = [solved[u] for u in system.qd]
        if not system.surely_regular:
            outputs = {f"qdd{i}": node for i, node in enumerate(solution)}
            require_inertia(system, system.graph(outputs, system.q, system.qd, system.tau))
        self.quadratic = not {*system.qd} & {*topological(solution)}
        self._solved = solved

    @cached_property
    def momenta(self) -> list[Node]:
        """p of (q, u)."""
        return cotangents({self.lagrangian: ONE}, self.system.qd, self.build)

    @cached_property
    def offset(self) -> list[Node]:
        """b, the momenta at u = 0; 0 of bodies."""
        if self.system.body_terms is not None:
            return [ZERO] * self.system.n
        return self.at_rest(self.momenta)

    @cached_property
    def velocities(self) -> list[Node]:
        """u of (q, p)."""
        return self.at(self.system.qd)

    def at(self, nodes: Sequence[Node]) -> list[Node]:
        """Nodes over (q, u), and any p, as nodes over (q, p)."""
        return folded(folded(nodes, self.build), self.build, self._replace)

    def tagged(self, nodes: Sequence[Node]) -> list[Node]:
        """The nodes of `at`; what of the velocities has no tags has those that all of their momentum has."""
        if self.system.body_terms is not None:  # their names are in every part
            return list(nodes)
        tags: dict[Node, frozenset[str]] = {}
        for velocity, momentum in zip(self.velocities, self.momenta, strict=True):
            common = [node.tags for node in topological([momentum]) if node.args]
            untagged = [node for node in topological([velocity]) if node.args and not node.tags]
            tags |= dict.fromkeys(untagged, frozenset.intersection(*common) if common else frozenset())
        copies: dict[Node, Node] = {}
        for node in topological(nodes):
            args, label = tuple([copies[arg] for arg in node.args]), node.label.tagged(tags.get(node, frozenset()))
            same = args == node.args and label is node.label
            copies[node] = node if same else Node(node.op, args, label, name=node.name)
        return [copies[node] for node in nodes]

    def at_rest(self, nodes: Sequence[Node]) -> list[Node]:
        """Nodes over (q, u) at u = 0."""
        return folded(nodes, self.build, self._at_rest)

    @cached_property
    def _replace(self) -> dict[Node, Node]:
        if not self.quadratic:
            return dict(zip(self.system.qd, self._iterated(), strict=True))
        with building(self.build):
            rhs = [p - b for p, b in zip(self.p, self.offset, strict=True)]
        # What is linear in u is at M^-1 (p - b) what the elimination has on its way back.
        linear = [z for z in linear_nodes(self.lagrangian, self.system.qd) if z in self._solved]
        replace = dict(zip(self.system.tau, rhs, strict=True)) | self._at_rest
        return dict(zip(linear, folded([self._solved[z] for z in linear], self.build, replace), strict=True))

    def _iterated(self) -> list[Node]:
        """The velocities at which L - p u is least, by Newton's steps from rest, shortened where they go too far."""
        rest = [ZERO] * self.system.n
        with building(self.build):
            wanted = [p - b for p, b in zip(self.p, self.offset, strict=True)]
        here, share = _Iterate(rest, wanted, self._step(rest, wanted)), ONE
        for k in range(1, self.iterations + 1):
            with building(self.build):
                work = dot(here.step, here.missing)  # step M step
                settled = cg.less_equal(cg.abs(work), SETTLED * cg.abs(dot(here.velocities, wanted)))
                share = cg.where(settled, 1.0, share)
                velocities = [u + share * step for u, step in zip(here.velocities, here.step, strict=True)]
            lagrangian, *momenta = self._at_velocities([self.lagrangian, *self.momenta], velocities)
            with building(self.build):
                missing = [p - momentum for p, momentum in zip(self.p, momenta, strict=True)]
                # the slope of L - p u along the step, at its end over at its start
                good = cg.less_equal(-OVERSHOOT, dot(here.step, missing) / work)
            step = here.step
            if k < self.iterations:
                step = self._step(velocities, missing)
                with building(self.build):
                    good = good * cg.less_equal(-OVERSHOOT, dot(step, missing) / work)
            with building(self.build):
                good = cg.where(settled, 1.0, good) * cg.less(cg.abs(lagrangian), math.inf)
                there = _Iterate(velocities, missing, step)
                pairs = [zip(new, old, strict=True) for new, old in zip(there, here, strict=True)]
                here = _Iterate(*[[cg.where(good, a, b) for a, b in pair] for pair in pairs])
                share = cg.where(good, cg.minimum(LONGER_SHARE * share, 1.0), SHORTER_SHARE * share)
        return here.velocities

    def _step(self, velocities: list[Node], missing: list[Node]) -> list[Node]:
        """M^-1 missing, at velocities."""
        return self._at_velocities([self._solved[u] for u in self.system.qd], velocities, missing)

    def _at_velocities(
        self, nodes: Sequence[Node], velocities: Sequence[Node], forces: Sequence[Node] = ()
    ) -> list[Node]:
        replace = dict(zip(self.system.qd, velocities, strict=True))
        return folded(nodes, self.build, replace | dict(zip(self.system.tau, forces, strict=False)))


class _Iterate(NamedTuple):
    """Velocities, what they leave of the momenta, and Newton's step from there."""

    velocities: list[Node]
    missing: list[Node]
    step: list[Node]


def is_quadratic(system: System) -> bool:
    """Whether L is quadratic in the velocities, so that they need no iteration."""
    return system.body_terms is not None or Legendre(system, Builder(), 1).quadratic


def linear_nodes(output: Node, variables: Sequence[Node]) -> list[Node]:
    """The nodes of an output that are linear in variables, 0 where they are, by what they are made of."""
    linear, moving = set(variables), set(variables)
    for node in topological([output]):
        if any([arg in moving for arg in node.args]):
            moving.add(node)
            one = [arg in linear for arg in node.args].count(True) == 1
            if node.op.name in ("add", "sub", "neg"):
                is_linear = all([arg in linear for arg in node.args])
            elif node.op.name == "mul":
                is_linear = one and not all([arg in moving for arg in node.args])
            else:
                is_linear = node.op.name == "div" and one and node.args[1] not in moving
            if is_linear:
                linear.add(node)
    return [*variables, *[node for node in topological([output]) if node in linear and node.args]]


def _require_canonical(system: System) -> None:
    """Raises for a system that has no Hamilton's equations in q and p alone."""
    if len(system.constraints):
        raise ConstraintError(
            f"constraint {system.constraints.names[0]!r} holds the momenta as well as the coordinates: Hamilton's "
            "equations need a system without constraints; take forward_dynamics"
        )
    taken = {f"p{i}" for i in range(system.n)} & system.parameters.keys()
    if taken:
        raise ValueError(f"parameter {min(taken)!r} has the name of a momentum; choose another")


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
