"""Lagrange's equation as forces on the velocity nodes of L: at qdd = 0 the bias, at others inverse dynamics.

Velocity nodes are nodes of a Lagrangian that are time derivatives of positions; they spare Lagrange's equation terms.

The mechanics. Let z(q, qd) = d/dt f(q) = (df/dq) qd be the time derivative of some function of the coordinates: a joint
velocity, the velocity of a point, an angular velocity about a fixed direction. Two identities hold for it:

    dz/dqd = df/dq                              ("cancellation of the dots")                                       (A)
    d/dt (dz/dqd) = (d2f/dq2) qd = dz/dq        (the operators d/dt and d/dq commute)                              (B)

For a Lagrangian written through such nodes, L(q, z(q, qd), t), the chain rule gives

    d/dt dL/dqd - dL/dq|total = sum_z [ (d/dt dL/dz) dz/dqd + dL/dz d/dt(dz/dqd) - dL/dz dz/dq ] - dL/dq|fixed z

and by (B) the second and third terms cancel:

    d/dt dL/dqd - dL/dq       = sum_z (d/dt dL/dz) dz/dqd - dL/dq|fixed z                                          (C)

What cancels is never built. The velocities qd are velocity nodes themselves (f = q_i), so every L is of this form, at
worst with z = qd, where (C) is Lagrange's equation as it stands.
"""

from collections.abc import Sequence
from typing import NamedTuple

from cgraph import Node
from cgraph._shared import UNLABELLED
from cgraph.extend import Builder, building, cotangents, folded, tangents, topological

from ..systems.kinematics import ONE, ZERO, changes, gathered
from ..systems.system import System


class BiasTerms(NamedTuple):
    """The terms of  d/dt dL/dqd - dL/dq = (sum over z of inertial_z dz/dqd) - gradient.

    z are the velocity nodes of L, and dz/dqd the partial velocities of Kane's equations: the bias is a set of forces,
    which forward dynamics by elimination takes as they are.
    """

    lagrangian: Node  # folded and shared
    forces: list[Node]  # applied ones, the same
    inertial: dict[Node, Node]  # d/dt dL/dz, by z
    gradient: list[Node]  # dL/dq at fixed z
    rates: list[Node]  # rows of velocities that constraints hold at 0

    def bias(self, system: System, build: Builder) -> list[Node]:
        """The sum at the coordinates: one reverse sweep carries all inertial terms from their velocities to qd."""
        inertial = cotangents(self.inertial, system.qd, build)
        with building(build):
            return [force - slope for force, slope in zip(inertial, self.gradient, strict=True)]


def state_rate(system: System, qdd: Sequence[Node] | None) -> dict[Node, Node]:
    """xdot of x = (q, qd), and 1 for t if anything depends on it.  qdd: accelerations, 0 if None."""
    rate = dict(zip(system.q, system.q_dot, strict=True)) | dict(zip(system.qd, qdd or (), strict=qdd is not None))
    return rate | ({system.t: ONE} if system.t in system.extra_inputs else {})


def along_motion(system: System, nodes: Sequence[Node], build: Builder, qdd: Sequence[Node] | None) -> list[Node]:
    """d/dt of nodes, one forward sweep.  qdd: accelerations, 0 if None."""
    return changes(state_rate(system, qdd), nodes, build)


def bias_terms(system: System, qdd: Sequence[Node] | None = None) -> BiasTerms:
    """Terms as bodies state them, or else derived from the Lagrangian.  qdd: accelerations, 0 if None."""
    if system.body_terms is None:
        return bias_terms_of_lagrangian(system, qdd)
    stated = system.body_terms.equations.bias_forces(system.q, system.qd, qdd)
    pairs = [node for pair in stated for node in pair]
    build = Builder()
    rates, n = system.constraints.rates, system.n
    lagrangian, *nodes = folded([system.lagrangian, *system.forces, *pairs, *rates], build)
    forces, pairs, rows = nodes[:n], nodes[n : n + len(pairs)], nodes[n + len(pairs) :]
    couples = zip(pairs[::2], pairs[1::2], strict=True)
    with building(build):  # a constant velocity does no virtual work
        inertial = gathered([(z, force) for z, force in couples if z.value is None and force.value != 0.0])
    return BiasTerms(lagrangian, forces, inertial, [ZERO] * system.n, rows)


def bias_terms_of_lagrangian(system: System, qdd: Sequence[Node] | None = None) -> BiasTerms:
    """Lagrange's equation of L(q, z(q, qd), t), term by term.  qdd: accelerations, 0 if None."""
    # Two builders: a term of L must not get the tags of an equal term that derives from it, and hand them on.
    written, build = Builder(), Builder()
    lagrangian, *nodes = folded([system.lagrangian, *system.forces, *system.constraints.rates], written)
    forces, rates = nodes[: system.n], nodes[system.n :]
    if system.kinematics.quasi is None:
        velocities = velocity_nodes(lagrangian, system.q, system.qd, system.t, written)
    else:  # the identities behind velocity nodes hold of rates of functions of q, which quasi-velocities are not
        velocities = list(system.qd)
    # dL/dq at fixed z, and dL/dz: one reverse sweep that stops at z.
    bars = cotangents({lagrangian: ONE}, [*system.q, *velocities], build, fixed=set(velocities))
    gradient, momenta = bars[: system.nq], bars[system.nq :]
    if system.kinematics.quasi is not None:
        gradient = system.kinematics.slopes(gradient, momenta, build)
    # d/dt dL/dz: eq. (4) of the paper with xdot = (qd, qdd), and 1 for t, one forward sweep.
    dots = tangents(state_rate(system, qdd), momenta, build)
    inertial = {velocity: dots[p] for velocity, p in zip(velocities, momenta, strict=True) if p in dots}
    return BiasTerms(lagrangian, forces, inertial, gradient, rates)


def velocity_nodes(output: Node, q: Sequence[Node], qd: Sequence[Node], t: Node, build: Builder) -> list[Node]:
    """The velocity nodes z = d/dt f(q) that `output` is made from: those used by anything that is no velocity node.

    Recognized are: qd_i; sums of velocity nodes; a velocity node times a constant; d/dt f(y) times g(y), for one node y
    of positions.  build: made the nodes of `output`.
    """
    recognition = _Recognition(q, qd, t, build)
    used: dict[Node, None] = {}
    for node in topological([output]):
        recognition.visit(node)
        if node not in recognition.position:
            used.update(dict.fromkeys([arg for arg in node.args if arg in recognition.position]))
    return [output] if output in recognition.position else list(used)


class _Recognition:
    """Knowledge of the nodes visited so far.

    moving: nodes that depend on velocities or on time.
    position: {z: f} of the velocity nodes, f None where it is not a node of the graph.
    through: {node: y} where the node depends on q through the one node y alone: of nodes of positions, as g(y), and of
        velocity nodes, as d/dt f(y). By (B) a product g(y) d/dt f(y) is again a velocity node, that of the integral of
        g f' over y, whether or not anybody can write that integral down.
    """

    def __init__(self, q: Sequence[Node], qd: Sequence[Node], t: Node, build: Builder) -> None:
        self.build = build
        self.moving = {*qd, t}
        self.through = {x: x for x in q} | dict(zip(qd, q, strict=True))  # qd_i = d/dt q_i depends on q through q_i
        self.position: dict[Node, Node | None] = dict(zip(qd, q, strict=True))

    def visit(self, node: Node) -> None:
        """Learn about a node, its arguments having been visited."""
        if not any([arg in self.moving for arg in node.args]):
            self._place(node)
            return
        self.moving.add(node)
        if node.op.name in ("add", "sub", "neg"):
            if all([arg in self.position for arg in node.args]):
                self._sum(node)
        elif node.op.name == "mul":
            for factor, velocity in (node.args, node.args[::-1]):
                if velocity in self.position:
                    self._scaled(node, factor, velocity)
        elif node.op.name == "div" and node.args[0] in self.position:
            self._scaled(node, node.args[1], node.args[0])

    def _place(self, node: Node) -> None:
        """A node of positions and constants depends on q through its arguments' one node, or is such a node itself."""
        by = {self.through[arg] for arg in node.args if arg in self.through}
        if by:
            self.through.setdefault(node, by.pop() if len(by) == 1 else node)

    def _sum(self, node: Node) -> None:
        """d/dt f1 + d/dt f2 = d/dt (f1 + f2): the position is the same sum of the positions."""
        places = [place for arg in node.args if (place := self.position[arg]) is not None]
        self.position[node] = None
        if len(places) == len(node.args):
            self._set_position(node, self.build(node.op, tuple(places), UNLABELLED))

    def _scaled(self, node: Node, factor: Node, velocity: Node) -> None:
        """A velocity node times (or divided by) a factor, which is a constant c or a function g(y) of positions."""
        if factor in self.moving:
            return
        if factor not in self.through:  # c d/dt f = d/dt (c f)
            self.position[node] = None
            if velocity in self.through:
                self.through[node] = self.through[velocity]
            if (place := self.position[velocity]) is not None:
                args = tuple([place if arg is velocity else arg for arg in node.args])
                self._set_position(node, self.build(node.op, args, UNLABELLED))
        elif velocity in self.through and self.through[factor] is self.through[velocity]:  # g(y) d/dt f(y), the same y
            self.position[node] = None
            self.through[node] = self.through[velocity]

    def _set_position(self, node: Node, place: Node) -> None:
        self._place(place)
        self.position[node] = place
        if place in self.through:
            self.through[node] = self.through[place]
