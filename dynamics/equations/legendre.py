"""The Legendre transform as nodes: the velocities that belong to momenta, and what else depends on them, put there."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import cgraph as cg
from cgraph import Node
from cgraph.extend import Builder, Order, SingularError, building, cotangents, folded, solve_tangents, topological

from ..systems.body_system import BodySystem
from ..systems.constraints import ConstraintError
from ..systems.system import System
from .equations_of_motion import require_inertia
from .formulations import ONE, ZERO
from .singular_mass_matrix import SingularMassMatrixError, no_inertia


class Legendre:
    """The velocities u of momenta p = dL/du at (q, p), solved for by elimination on the graph of L.

    Where L is quadratic in u, p = M u + b, they are M^-1 (p - b). Else they are iterated: Newton's steps from u = 0,
    the first half of them towards momenta between that of u = 0 and p, one after another, so that none goes far.

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
        if not isinstance(system, BodySystem):
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
        if isinstance(self.system, BodySystem):
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
        if isinstance(self.system, BodySystem):  # their names are in every part
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
        system, build = self.system, self.build
        with building(build):
            step = [u + self._solved[u] for u in system.qd]
        velocities: list[Node] = [ZERO] * system.n
        for k in range(1, self.iterations + 1):
            share = min(1.0, 2.0 * k / self.iterations)
            momenta = folded(self.momenta, build, dict(zip(system.qd, velocities, strict=True)))
            with building(build):
                aims = [b + share * (p - b) for p, b in zip(self.p, self.offset, strict=True)]
                missing = [aim - here for aim, here in zip(aims, momenta, strict=True)]
            replace = zip((*system.qd, *system.tau), (*velocities, *missing), strict=True)
            velocities = folded(step, build, dict(replace))
        return velocities


def is_quadratic(system: System) -> bool:
    """Whether L is quadratic in the velocities, so that they need no iteration."""
    return isinstance(system, BodySystem) or Legendre(system, Builder(), 1).quadratic


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
