"""Total, kinetic and potential energy as graphs."""

from __future__ import annotations

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Builder, building, cotangents

from ..systems.body_system import BodySystem
from ..systems.model import Model, as_system
from ..systems.system import System
from .formulations.formulations import ONE, ZERO
from .shorter_form import shorter_form
from .substitute import substitute


def energy(model: Model) -> Graph:
    """Total energy E = qd . dL/dqd - L, which is K + P for a kinetic energy quadratic in qd.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; output E [J].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'E': 4.0}
    """

    def derive(system: System) -> Graph:
        build = Builder()
        bars = cotangents({system.lagrangian: ONE}, system.qd, build)
        with building(build):
            total: Node = ZERO
            for p, qd in zip(bars, system.qd, strict=True):
                total = total + p * qd
            total = total - system.lagrangian
        return cg.simplify(system.graph({"E": total}, system.q, system.qd))

    return shorter_form(as_system(model), derive)


def kinetic_energy(model: Model) -> Graph:
    """The part K of the energy that motion adds, K = E - P; of bodies and springs the usual one.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; output K [J].

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.kinetic_energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'K': 2.0}
    """

    def derive(system: System) -> Graph:
        return cg.simplify(system.graph({"K": _kinetic(system)}, system.q, system.qd))

    return shorter_form(as_system(model), derive)


def potential_energy(model: Model) -> Graph:
    """The energy at rest, P = -L at qd = 0: that of gravity and springs.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.

    Returns
    -------
    Graph
        Inputs q0.., qd0.., t if needed, parameters; output P [J]. Of bodies it is 0 where all of them are at the
        world's origin, and springs at their reference.

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 2.0 * q[0] ** 2, ["x"])
    >>> dyn.potential_energy(spring).evaluate({"q0": 1.0, "qd0": 2.0})
    {'P': 2.0}
    """

    def derive(system: System) -> Graph:
        with building(Builder()):
            at_rest = system.potential - _at_rest(system)
        return cg.simplify(system.graph({"P": at_rest}, system.q, system.qd))

    return shorter_form(as_system(model), derive)


def _kinetic(system: System) -> Node:
    """qd . dT/dqd - T + T(qd = 0) for the terms T of L that depend on qd: T itself where it is quadratic."""
    if isinstance(system, BodySystem):
        return system.kinetic
    build = Builder()
    momenta = cotangents({system.kinetic: ONE}, system.qd, build)
    with building(build):
        work = sum([p * qd for p, qd in zip(momenta, system.qd, strict=True)], ZERO)
        return work - system.kinetic + _at_rest(system)


def _at_rest(system: System) -> Node:
    """T(qd = 0), which is 0 of bodies."""
    (node,) = substitute([system.kinetic], dict.fromkeys(system.qd, ZERO))
    return node
