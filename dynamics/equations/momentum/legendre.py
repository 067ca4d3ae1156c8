"""The Legendre transform as nodes: the velocities that belong to momenta, and what else depends on them, put there."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import cgraph as cg
from cgraph import Node
from cgraph._shared import Order, solve_tangents
from cgraph.extend import Builder, SingularError, building, cotangents, folded, topological

from ...systems.constraints import ConstraintError
from ...systems.kinematics import ONE, ZERO, dot
from ...systems.system import System
from ..mass_matrix.singular_mass_matrix import SingularMassMatrixError, no_inertia, require_inertia

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
