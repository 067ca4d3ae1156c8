"""If, While, FixedPoint: statements that others are inside of, run as often as a register says."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..statement import Execution, Lengths, Statement, require_length

if TYPE_CHECKING:
    from ..writer import Writer


@dataclass(frozen=True)
class While(Statement):
    """while (register > 0) body; the register has length 1, and NaN is not positive.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, While
    >>> n = cg.variable("n")
    >>> countdown = While("n", (Call(cg.Graph([n], {"less": n - 1.0}), ("n",), ("n",)),))
    """

    register: str
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class If(Statement):
    """if (register > 0) body else otherwise; the register has length 1, and NaN is not positive.

    seldom: whether it hardly ever runs, so that its speed is not worth the time to compile more code.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, If
    >>> n = cg.variable("n")
    >>> not_below_zero = If("n", (), (Call(cg.Graph([], {"zero": 0.0}), (), ("n",)),))
    """

    register: str
    body: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()
    seldom: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class FixedPoint(Statement):
    """while (register > 0) body, which ends at v = body(v, e), v the registers that a turn hands on to the next.

    It runs as `While` does. Its derivative is that of v in terms of e, v' = (dT/dv) v' + (dT/de) e', which is solved by
    the same iteration, and knows nothing of how many turns v took, nor from where. A turn has no `If`, `While`,
    `Factor`.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, FixedPoint
    >>> v, turns = cg.variables("v turns")
    >>> turn = cg.Graph([v, turns], {"v": cg.cos(v), "turns": turns - 1.0})
    >>> dottie = FixedPoint("turns", (Call(turn, ("v", "turns"), ("v", "turns")),))
    """

    register: str
    body: tuple[Statement, ...]


def check_control(statement: While | If | FixedPoint, lengths: Lengths) -> None:
    """Raises GraphError if what decides is no single number."""
    require_length(lengths, type(statement).__name__, statement.register, 1)


def run_while(statement: While | FixedPoint, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python; of many memories, as long as the register is positive in any."""
    while execution.positive(state[statement.register]):
        execution.run(statement.body, state)


def run_if(statement: If, state: dict[str, Any], execution: Execution) -> None:
    """Run in Python; of many memories, the body if the register is positive in any."""
    positive = execution.positive(state[statement.register])
    execution.run(statement.body if positive else statement.otherwise, state)


def while_text(statement: While | FixedPoint, writer: Writer) -> None:
    """Write as machine code."""
    with writer.repeat() as end:
        writer.leave_unless(writer.positive(statement.register), end)
        writer.run(statement.body)


def if_text(statement: If, writer: Writer) -> None:
    """Write as machine code."""
    functions = writer.functions
    before, functions.quick = functions.quick, functions.quick or statement.seldom
    with writer.when(writer.positive(statement.register)) as otherwise:
        writer.run(statement.body)
        if statement.otherwise:
            otherwise()
            writer.run(statement.otherwise)
    functions.quick = before
