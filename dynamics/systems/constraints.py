"""Constraints of a system: rows phi(q, t) = 0, and rows A(q, t) u + a(q, t) = 0 of its velocities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from types import MappingProxyType
from typing import NamedTuple

from cgraph import Node
from cgraph._shared import Array, check_name, shortened
from cgraph.extend import Builder, cotangents, topological

from .arguments import Parameters, call_user_function, node_or_number, sequence
from .kinematics import ONE, ZERO, Kinematics, changes

Function = Callable[..., object]


class ConstraintError(ValueError):
    """Constraints that cannot be met, or of which some follow from others; the message names them.

    Examples
    --------
    >>> import dynamics as dyn
    >>> def energy(q, qd, t):
    ...     return 0.5 * qd[0] ** 2
    >>> try:
    ...     dyn.forward_dynamics(dyn.System(energy, "x", constraints=lambda q, t: {"wall": q[0] * q[0] + 1.0}))
    ... except dyn.ConstraintError as error:
    ...     print(error)
    the constraints cannot be met: no state was seen where 'wall' is 0
    """


class LoopRow(NamedTuple):
    """A row of a loop that holds frames of bodies: which loop, and whether it is of an angle or of a length.

    tolerance: how much of it has to be new beside the others, of the largest row of the loop.
    """

    loop: str
    angle: bool
    tolerance: float


class Constraints:
    """The rows that hold a system, as nodes.

    names: of all rows, m: those of positions, then those of velocities alone.
    positions: phi.  velocities: A u + a, linear in the velocities.  parameters: values by name.
    loop_rows: of the rows that loops have, by name.  turning: whether each velocity is of an angle.
    given: states that callers gave, (q, t, parameters), where rows are looked at if no other meets them.
    whole: the constraints with all rows, where some are 0 as they nearly follow from others; left_out: these, and gaps.
    """

    loop_rows: Mapping[str, LoopRow] = MappingProxyType({})
    turning: Sequence[bool] = ()
    whole: Constraints | None = None
    left_out: Mapping[int, float] = MappingProxyType({})

    def __init__(
        self,
        kinematics: Kinematics,
        t: Node,
        parameters: Mapping[str, float],
        positions: Function | None,
        velocities: Function | None,
    ) -> None:
        self.kinematics, self.t, self.parameters = kinematics, t, parameters
        p = Parameters(parameters)
        q, u = kinematics.q, kinematics.u
        given: dict[str, tuple[Node, ...]] = {}
        self.names: list[str] = []
        for what, function, arguments in (
            ("constraints", positions, (q, t, p)),
            ("velocity_constraints", velocities, (q, u, t, p)),
        ):
            rows = {} if function is None else _rows(what, call_user_function(what, function, *arguments, state="q"))
            given[what] = tuple(rows.values())
            self.names += rows
        twice = [name for i, name in enumerate(self.names) if name in self.names[:i]]
        if twice:
            raise ValueError(f"two constraints have the name {twice[0]!r}")
        self.positions, self.velocities = given.values()
        self.given: list[tuple[Array, float, Mapping[str, float]]] = []
        if set(u) & set(topological(self.positions)):
            raise ValueError("constraints must depend on coordinates, t and parameters alone; see velocity_constraints")
        for name, row in zip(self.names[len(self.positions) :], self.velocities, strict=True):
            if set(u) & set(topological(cotangents({row: ONE}, u))):
                raise ValueError(f"velocity constraint {name!r} must be linear in the velocities")

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def rates(self) -> tuple[Node, ...]:
        """All rows as rows of velocities, z(q, u, t) = 0: d phi/dt = J u + d phi/dt at rest, then A u + a."""
        return (*self.rate_changes(self.positions, Builder()), *self.velocities)

    def rate_changes(self, rows: Sequence[Node], build: Builder, u_dot: Sequence[Node] | None = None) -> list[Node]:
        """d/dt of rows, as they are folded elsewhere.  u_dot: accelerations, 0 if None."""
        k = self.kinematics
        along = dict(zip(k.q, k.q_dot, strict=True)) | dict(zip(k.u, u_dot or (), strict=u_dot is not None))
        return changes(along | {self.t: ONE}, rows, build)

    def without(self, dropped: Mapping[int, float]) -> Constraints:
        """The constraints with 0 for some rows, which are open by so much."""
        other, count = copy(self), len(self.positions)
        other.__dict__.pop("rates", None)
        rows = [ZERO if k in dropped else row for k, row in enumerate((*self.positions, *self.velocities))]
        other.positions, other.velocities, other.whole = tuple(rows[:count]), tuple(rows[count:]), self
        other.left_out = dropped
        return other

    def require_slopes(self) -> None:
        """Raises ValueError for a row that no velocity can change, whatever the state: it would hold nothing."""
        for i, (name, row) in enumerate(zip(self.names, self.rates, strict=True)):
            if any([slope.value != 0.0 for slope in shortened(cotangents({row: ONE}, self.kinematics.u, Builder()))]):
                continue
            if i < len(self.positions):
                raise ValueError(f"constraint {name!r} is the same at all coordinates, so it holds nothing")
            where = "a condition on positions belongs to constraints="
            raise ValueError(f"velocity constraint {name!r} has no velocity in it; {where}")


def _rows(what: str, given: object) -> dict[str, Node]:
    """{name: node}, names from a mapping, or numbered."""
    if isinstance(given, Node):
        given = [given]
    if not isinstance(given, Mapping):
        kind = what.rstrip("s").replace("_", " ")
        given = {f"{kind} {i}": row for i, row in enumerate(sequence(f"{what} must give", given))}
    for name in given:
        check_name("a constraint", name)
    return {name: node_or_number(f"constraint {name!r}", row) for name, row in given.items()}
