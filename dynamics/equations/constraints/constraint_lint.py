"""Lint of constraints: which rows of velocities hold positions, and whether L has multipliers of others."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cgraph import Node
from cgraph.extend import Builder, cotangents, topological

from ...systems.constraints import Constraints
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import documented
from ..formulations.formulations import ONE
from .integrability import integrable_rows

if TYPE_CHECKING:
    from cgraph.extend import Json


@dataclass(frozen=True)
class ConstraintLint:
    """The result of `lint_constraints`; `str` of it is the report.

    Parameters
    ----------
    integrable : mapping
        {name of a row of velocities: whether it holds a position}; None of rows that depend on time, which is not
        judged.
    vakonomic : mapping
        {coordinate that is a multiplier in L: whether its row is not integrable}, likewise.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.lint_constraints(dyn.planar_arm([1.0], [1.0])).ok
    True
    """

    integrable: Mapping[str, bool | None]
    vakonomic: Mapping[str, bool | None]

    @property
    def ok(self) -> bool:
        """Whether L has no multipliers of rows that are not integrable."""
        return not any(self.vakonomic.values())

    def __str__(self) -> str:
        """A line for each row and each multiplier."""
        rows = {
            True: "is integrable: it holds a position, and phi(q) = 0 among the constraints would keep it, too",
            False: "is not integrable (nonholonomic): it holds velocities alone. Its multiplier must not be in L, as "
            "the motion that makes that action stationary (vakonomic) is another",
            None: "depends on time, and is not judged",
        }
        multipliers = {
            True: "is a multiplier in L of a row that is not integrable: the motion is vakonomic, and not that of a "
            "body that rolls or slides; give the row as velocity_constraints",
            False: "is a multiplier in L of a row that is integrable; give the row as velocity_constraints",
            None: "is a multiplier in L of a row that depends on time, which is not judged",
        }
        lines = [f"velocity constraint {name!r} {rows[said]}" for name, said in self.integrable.items()]
        return "\n".join(lines + [f"coordinate {name!r} {multipliers[said]}" for name, said in self.vakonomic.items()])

    def to_dict(self) -> dict[str, Json]:
        """For JSON."""
        return {"ok": self.ok, "integrable": dict(self.integrable), "vakonomic": dict(self.vakonomic)}


@documented
def lint_constraints(model: Model) -> ConstraintLint:
    """Say of every row of velocities whether it is integrable, and whether L has a multiplier of one that is not.

    Of rows that are not rates of positions, as those of rolling, bodies move by d'Alembert's principle: the rows hold
    the motion by J^T lambda, as `System(velocity_constraints=)` has it. With multipliers in L, L + mu . (A qd), the
    action is stationary among the motions that meet the rows, which is another motion (vakonomic). A coordinate
    without a velocity in L is such a multiplier if the slope of L along it is linear in velocities.

    Returns
    -------
    ConstraintLint

    Raises
    ------
    ConstraintError
        Where no state is seen that meets the constraints.

    Examples
    --------
    A blade on ice, once as it is, and once with its multiplier in L:

    >>> import cgraph as cg
    >>> import dynamics as dyn
    >>> def blade(q, qd, t):
    ...     return {"blade": cg.cos(q[2]) * qd[1] - cg.sin(q[2]) * qd[0]}
    >>> def energy(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + qd[1] ** 2 + 0.3 * qd[2] ** 2)
    >>> dyn.lint_constraints(dyn.System(energy, "x y angle", velocity_constraints=blade)).integrable
    {'blade': False}
    >>> def action(q, qd, t):
    ...     return energy(q, qd, t) + q[3] * blade(q, qd, t)["blade"]
    >>> dyn.lint_constraints(dyn.System(action, "x y angle mu")).vakonomic
    {'mu': True}
    """
    system = as_system(model)
    alone = _judged(system)
    names = system.constraints.names[len(system.constraints.positions) :]
    rows = _multiplied(system)
    held = _judged(_with_rows(system, rows)) if rows else {}
    return ConstraintLint(
        {name: alone[name] for name in names},
        {name: None if held[name] is None else not held[name] for name in rows},
    )


def _judged(system: System) -> dict[str, bool | None]:
    """`integrable_rows`; of rows that do not depend on time, if others do."""
    constraints = system.constraints
    timed = {name for name, z in zip(constraints.names, constraints.rates, strict=True) if system.t in topological([z])}
    if not timed:
        return dict(integrable_rows(system))
    count = len(constraints.positions)
    kept = [name for name in constraints.names[count:] if name not in timed]
    rows = dict(zip(constraints.names[count:], constraints.velocities, strict=True))
    judged = integrable_rows(_with_rows(system, {name: rows[name] for name in kept}))
    return {name: judged.get(name) for name in constraints.names}


def _with_rows(system: System, rows: Mapping[str, Node]) -> System:
    """The system held by these rows of velocities alone."""
    other = copy(system)
    given = (system.kinematics, system.t, system.parameters)
    other.constraints = Constraints(*given, None, lambda q, u, t, p: dict(rows))
    return other


def _multiplied(system: System) -> dict[str, Node]:
    """{coordinate without velocity in L: slope of L along it, where that is linear in the velocities}."""
    if system.kinematics.quasi is not None:
        return {}
    build = Builder()
    slopes = cotangents({system.lagrangian: ONE}, system.q, build)
    reached = set(topological([system.lagrangian]))
    rows = {}
    for name, q, u, slope in zip(system.coordinates, system.q, system.qd, slopes, strict=True):
        below = set(topological([slope]))
        if u in reached or q in below or not below & set(system.qd):
            continue
        curved = topological(cotangents({slope: ONE}, system.qd, build))
        if not set(curved) & set(system.qd):
            rows[name] = slope
    return rows
