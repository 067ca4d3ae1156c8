"""Total, kinetic and potential energy as graphs."""

from __future__ import annotations

from collections.abc import Iterator

from cgraph import Node
from cgraph.extend import Builder, building, cotangents

from ..systems.kinematics import ONE, ZERO, dot
from ..systems.system import System
from .equation import Equation, Output
from .substitute import substitute


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
    yield [_legendre(system, system.lagrangian)]


@Equation("q qd", Output("K", (), "J"))
def kinetic_energy(system: System) -> Iterator[list[Node]]:
    """The part K of the energy that motion adds, K = E - P; of bodies and springs the usual one.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.kinetic_energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'K': 2.0}
    """
    if system.body_terms is not None:
        yield [system.kinetic]
        return
    motion = _legendre(system, system.kinetic)
    with building(Builder()):  # of the terms T of L that depend on qd; where they are quadratic, T itself
        total = motion + _at_rest(system)
    yield [total]


@Equation("q qd", Output("P", (), "J"))
def potential_energy(system: System) -> Iterator[list[Node]]:
    """The energy at rest, P = -L at qd = 0: that of gravity and springs.

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
    with building(Builder()):
        at_rest = system.potential - _at_rest(system)
    yield [at_rest]


def _legendre(system: System, lagrangian: Node) -> Node:
    """qd . dL/dqd - L."""
    build = Builder()
    momenta = cotangents({lagrangian: ONE}, system.qd, build)
    with building(build):
        return dot(momenta, system.qd) - lagrangian


def _at_rest(system: System) -> Node:
    """T(qd = 0), which is 0 of bodies."""
    (node,) = substitute([system.kinetic], dict.fromkeys(system.qd, ZERO))
    return node
