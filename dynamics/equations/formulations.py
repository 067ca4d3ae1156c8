"""The formulations of Lagrange's equation as graphs: by definition, kinetic only, and by the chain rule."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import TANGENT, Builder, building, cotangents, tangents, topological

from ..systems.model import Model, as_system
from ..systems.system import System

EULER = "euler"  # tag of the embedded relations q = qd dt + q_old and qd = qdd dt + qd_old
COUPLING = "q of qd"  # tag of the product qd dt in the first of them, through which dL/dqd reaches dL/dq
ONE, ZERO = cg.constant(1.0), cg.constant(0.0)


class Terms(NamedTuple):
    """What a formulation makes: the two terms of tau = d/dt dL/dqd - dL/dq, and the state they are taken at."""

    inputs: list[Node]
    q: list[Node]
    qd: list[Node]
    momentum: list[Node]  # p = dL/dqd
    momentum_rate: list[Node]  # d/dt dL/dqd
    gradient: list[Node]  # dL/dq


def chain_rule(system: System) -> Terms:
    """d/dt p = grad_x p . xdot for p = dL/dqd, x = (q, qd), contracted: one reverse sweep, then one forward."""
    build = Builder()
    n = system.n
    bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd], build)
    gradient, momentum = bars[:n], bars[n:]
    dots = tangents(_state_rate(system), momentum, build)
    rate = [dots.get(p, ZERO) for p in momentum]
    return Terms([*system.q, *system.qd, *system.qdd], system.q, system.qd, momentum, rate, gradient)


def chain_rule_literal(system: System) -> Terms:
    """The chain rule read literally: all 2n gradients of each momentum, one reverse sweep each, then dot products."""
    n = system.n
    bars = cotangents({system.lagrangian: ONE}, [*system.q, *system.qd])
    gradient, momentum = bars[:n], bars[n:]
    x_dot = _state_rate(system)
    rate = []
    for p in momentum:
        slopes = cotangents({p: ONE}, list(x_dot))
        with building(Builder()) as labelled:
            labelled(p.label.derived(TANGENT))
            total = ZERO
            for slope, dot in zip(slopes, x_dot.values(), strict=True):
                total = total + slope * dot
        rate.append(total)
    return Terms([*system.q, *system.qd, *system.qdd], system.q, system.qd, momentum, rate, gradient)


def euler_embedded(system: System) -> Terms:
    """By definition, with the Euler relation in the graph: dL/dqd is taken through q = qd dt + q_old (eq. 3: wrong)."""
    return _embedded(system, system.lagrangian)


def kinetic_only(system: System) -> Terms:
    """The same embedding with K in place of L in the velocity derivative: right only where K does not depend on q."""
    return _embedded(system, system.kinetic)


def kinetic_only_exact(system: System) -> Terms:
    """Kinetic only, exact: dK/dqd is taken at independent q and qd, and only then is the relation embedded.

    d/dt goes through each embedded quantity at its own rate, qd of q and qdd of qd, not through dt, along which q would
    move at qd + qdd dt.
    """
    momentum = cotangents({system.kinetic: ONE}, system.qd)
    embedding = _Embedding(system)
    lagrangian, *embedded = embedding.of(system.lagrangian, *momentum)
    gradient = cotangents({lagrangian: ONE}, embedding.q)
    rates = dict(zip([*embedding.q, *embedding.qd], [*embedding.qd, *system.qdd], strict=True))
    return embedding.terms(embedded, gradient, rates)


FORMULATIONS: dict[str, Callable[[System], Terms]] = {
    each.__name__: each for each in (chain_rule, chain_rule_literal, euler_embedded, kinetic_only, kinetic_only_exact)
}


def inverse_dynamics(model: Model, formulation: str = "chain_rule", *, simplify: bool = True) -> Graph:
    """tau of the motion: tau = d/dt dL/dqd - dL/dq + damping * qd - forces, by one of the `FORMULATIONS`.

    "chain_rule", "chain_rule_literal": inputs q0.., qd0.., qdd0.., then t if needed and parameters.
    "euler_embedded", "kinetic_only", "kinetic_only_exact": the state before the step, q0_old.., qd0_old.., then
    qdd0.., dt, ...; tau is that of the state after the step, qd = qdd dt + qd_old, q = qd dt + q_old.
    Outputs tau0.. [N m or N]. simplify=False leaves the graph as derived.

    Raises ValueError for an unknown formulation.
    """
    system = as_system(model)
    terms = _terms(system, formulation)
    applied = _forces(system, terms)
    build = Builder()
    outputs = {}
    with building(build):
        for i in range(system.n):
            tau = terms.momentum_rate[i] - terms.gradient[i]
            with cg.tag("damping"):
                tau = tau + system.damping[i] * terms.qd[i]
            outputs[f"tau{i}"] = tau - applied[i]
    return _finished(system.graph(outputs, terms.inputs), simplify)


def momentum_rate(
    model: Model, formulation: str = "chain_rule", *, simplify: bool = True, keep_momentum: bool = False
) -> Graph:
    """The inertial term d/dt dL/dqd alone, outputs p0_dot.. : the left side of Eq. (3) and of Figures 1 to 3.

    keep_momentum: the momenta p0.. = dL/dqd are outputs too. Inputs, formulations and errors as for `inverse_dynamics`.
    """
    system = as_system(model)
    terms = _terms(system, formulation)
    outputs = {f"p{i}": p for i, p in enumerate(terms.momentum)} if keep_momentum else {}
    outputs |= {f"p{i}_dot": rate for i, rate in enumerate(terms.momentum_rate)}
    return _finished(system.graph(outputs, terms.inputs), simplify)


def spurious_nodes(graph: Graph) -> frozenset[Node]:
    """Nodes that are there only because a derivative was taken through the embedded Euler relation.

    They are the adjoints that the product qd dt of q = qd dt + q_old passes on, and all that only these need.
    """
    coupling = {node for node in graph.nodes if COUPLING in node.tags and "adjoint" in node.roles}
    reached: set[Node] = set()
    stack = [node for node in graph.outputs.values() if node not in coupling]
    while stack:
        node = stack.pop()
        if node not in reached:
            reached.add(node)
            stack.extend(arg for arg in node.args if arg not in coupling)
    return frozenset(node for node in graph.nodes if node not in reached)


def _terms(system: System, formulation: str) -> Terms:
    if formulation not in FORMULATIONS:
        raise ValueError(f"formulation must be one of {', '.join(FORMULATIONS)}, got {formulation!r}")
    return FORMULATIONS[formulation](system)


def _forces(system: System, terms: Terms) -> list[Node]:
    """The system's forces at the state of the terms: itself, or the embedded one."""
    if terms.q is system.q:
        return list(system.forces)
    return substituted(system.forces, dict(zip([*system.q, *system.qd], [*terms.q, *terms.qd], strict=True)))


def _finished(graph: Graph, simplify: bool) -> Graph:
    return cg.simplify(graph) if simplify else graph


def _state_rate(system: System) -> dict[Node, Node]:
    """xdot for x = (q, qd), and 1 for t if the Lagrangian depends on it."""
    rate = dict(zip([*system.q, *system.qd], [*system.qd, *system.qdd], strict=True))
    return rate | ({system.t: ONE} if system.t in system.extra_inputs else {})


class _Embedding:
    """The Euler relation as nodes: the state after a step from variables of the state before it."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.dt = cg.variable("dt")
        q_old = cg.variables([f"q{i}_old" for i in range(system.n)])
        qd_old = cg.variables([f"qd{i}_old" for i in range(system.n)])
        self.inputs = [*q_old, *qd_old, *system.qdd, self.dt]
        with cg.tag(EULER):
            self.qd = [
                cg.with_name(a * self.dt + old, f"qd{i}")
                for i, (a, old) in enumerate(zip(system.qdd, qd_old, strict=True))
            ]
            with cg.tag(COUPLING):
                moved = [v * self.dt for v in self.qd]
            self.q = [cg.with_name(m + old, f"q{i}") for i, (m, old) in enumerate(zip(moved, q_old, strict=True))]

    def of(self, *nodes: Node) -> list[Node]:
        """Nodes over (q, qd) as nodes over the embedded state."""
        return substituted(nodes, dict(zip([*self.system.q, *self.system.qd], [*self.q, *self.qd], strict=True)))

    def terms(self, momentum: Sequence[Node], gradient: list[Node], rates: dict[Node, Node] | None = None) -> Terms:
        """d/dt as the derivative with respect to dt, or along `rates`; and to t if the Lagrangian has it."""
        seeds = (rates or {self.dt: ONE}) | ({self.system.t: ONE} if self.system.t in self.system.extra_inputs else {})
        dots = tangents(seeds, momentum)
        rate = [dots.get(p, ZERO) for p in momentum]
        return Terms(self.inputs, self.q, self.qd, list(momentum), rate, gradient)


def _embedded(system: System, energy: Node) -> Terms:
    embedding = _Embedding(system)
    lagrangian, energy = embedding.of(system.lagrangian, energy)
    momentum = cotangents({energy: ONE}, embedding.qd)  # through q as well: the unwanted coupling
    gradient = cotangents({lagrangian: ONE}, embedding.q)
    return embedding.terms(momentum, gradient)


def substituted(nodes: Sequence[Node], replace: dict[Node, Node]) -> list[Node]:
    """Copies of nodes with others in place of variables, operations kept as written."""
    inputs = [node for node in topological(nodes) if node.op.name == "variable"]
    graph = Graph(inputs, {str(i): node for i, node in enumerate(nodes)})
    return list(graph(*[replace.get(node, node) for node in inputs]).values())
