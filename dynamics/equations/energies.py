"""Total, kinetic and potential energy as graphs."""

from __future__ import annotations

from collections.abc import Iterator

from cgraph import Node
from cgraph.extend import Builder, building, cotangents

from ..systems.kinematics import ONE, dot
from ..systems.system import System
from .equation import Equation, Output


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
