"""Step: one step of a size that is handed in, as statements, which is what derivatives of motions are taken of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cgraph.extend import FixedPoint, Statement, While


@dataclass(frozen=True, eq=False)
class Step:
    """One step from the state x at t, of h: registers x, t, h, p as in `Method`, and those that it needs besides.

    Whether a step is accepted, and how long the next one is, is not its business.

    lengths: of the registers besides.  start: what is done before the first step, with x at the start in `x`.
    body: the step itself, with no `If`; what it hands on to the next one is in registers that it both reads and writes.
    fixed: registers whose values have no derivatives: guesses, roundings, matrices of an iteration.
    failed: a register that is not 0 after a step whose equations were not solved; empty where nothing is iterated.
    """

    lengths: dict[str, int]
    start: Sequence[Statement]
    body: Sequence[Statement]
    fixed: tuple[str, ...] = ()
    failed: str = ""

    @property
    def iterates(self) -> bool:
        """Whether it turns as often as numbers say, so that steps side by side wait for one another."""
        return any(isinstance(each, While | FixedPoint) for each in (*self.start, *self.body))
