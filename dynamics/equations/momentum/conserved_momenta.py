"""Conserved momenta: the coordinates that the equations of motion do not depend on, as the graph shows."""

from __future__ import annotations

from collections.abc import Sequence

from cgraph import Node
from cgraph._shared import columns, shortened
from cgraph.extend import Builder, as_node, building, cotangents, folded, topological

from ...systems.arguments import new_variables
from ...systems.kinematics import ONE, ZERO
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented


@documented
def conserved_momenta(model: Model) -> tuple[str, ...]:
    """The velocities whose momenta p = dL/dqd are constant while no tau acts on them: cyclic coordinates (Noether).

    Proven by structure: the rate dL/dq + forces - damping * qd, of quasi-velocities G^T dL/dq - ad(u; p) in place of
    dL/dq, folds to the constant 0, L does not jump along it, and no constraint pulls there. What is not named may be
    conserved all the same, by an identity that no fold knows; what is named is at every state and for all values of
    the parameters.

    Returns
    -------
    tuple of str
        Names of velocities, which of a system without quasi-velocities are those of coordinates.

    Examples
    --------
    A planet in polar coordinates: its angular momentum.

    >>> import dynamics as dyn
    >>> def planet(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) + 1.0 / q[0]
    >>> dyn.conserved_momenta(dyn.System(planet, "r phi"))
    ('phi',)
    """
    system = as_system(model)
    constant: set[int] = set()
    for form in (system, system.shortened):
        if form is not None:
            constant |= {i for i, rate in enumerate(_rates(form)) if rate.value == 0.0} - _jumping(form)
    slopes = [cotangents({rate: ONE}, system.qd, Builder()) for rate in system.constraints.rates]
    constrained = {i for row in slopes for i, slope in enumerate(row) if slope.value != 0.0}
    return tuple([name for i, name in enumerate(system.velocities) if i in constant - constrained])


def _rates(system: System) -> list[Node]:
    """Rates of the momenta at tau = 0, as short as they get."""
    build = Builder()
    p = new_variables("p", system.n, system.parameters)
    stated: Sequence[Node] | None = None
    if system.body_terms is not None:
        stated = system.body_terms.equations.momentum_rates(system.q, system.qd, p)
    if stated is None:
        (lagrangian,) = folded([system.lagrangian], build)
        bars = cotangents({lagrangian: ONE}, [*system.q, *system.qd], build)
        stated = system.kinematics.slopes(bars[: system.nq], bars[system.nq :], build)
    parts = zip(folded(stated, build), system.forces, system.damping, system.qd, strict=True)
    with building(build):
        rates = [rate + force - damping * qd for rate, force, damping, qd in parts]
    return shortened(folded(rates, build))


def _jumping(system: System) -> set[int]:
    """The velocities along which L jumps, as `floor` and the condition of `where` do: beside a jump its slope is 0."""
    build = Builder()
    (lagrangian,) = folded([system.lagrangian], build)
    moving: set[int] = set()
    for node in topological([lagrangian]):
        with building(build):
            partials = map(as_node, node.op.partials(node, *node.args)) if node.args else ()
        for arg, partial in zip(node.args, partials, strict=True):
            if columns(node.op).jumps or partial.value == 0.0:
                slopes = system.kinematics.slopes(cotangents({arg: ONE}, system.q, build), [ZERO] * system.n, build)
                moving |= {i for i, slope in enumerate(slopes) if slope.value != 0.0}
    return moving
