"""Lagrange's equation as forces on the velocity nodes of L: at qdd = 0 the bias, at others inverse dynamics."""

from collections.abc import Sequence
from typing import NamedTuple

from cgraph import Node
from cgraph.extend import Builder, building, cotangents, folded, tangents

from ..systems.kinematics import ONE, ZERO, changes, gathered
from ..systems.system import System
from .velocity_nodes import velocity_nodes


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
