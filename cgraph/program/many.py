"""`many`: the program of memories side by side, which takes the course of each of them: by masks and choices."""

from __future__ import annotations

from dataclasses import replace

from .masks import Masked
from .program import Program
from .statement import row_of


def many(program: Program) -> Program:
    """The program with its branches and loops under masks, for memories side by side.

    What its `If` and `While` decide by is 1 where they apply and else 0, and what they write is put back where they do
    not. So every memory, a lane, ends with the same numbers whether other lanes take another course or not: an `If` is
    run if any lane is positive, and a `While` as long as any is. `Runner.run_many` makes it of its program.

    Parameters
    ----------
    program : Program
        Of any statements; a `FixedPoint` becomes a `While`, so that derivatives are taken before.

    Returns
    -------
    Program
        With registers for masks, and for what is put back, after those of the program; `program` itself if nothing in
        it depends on numbers.

    Raises
    ------
    TypeError
        For what is no program.

    Examples
    --------
    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, While, many
    >>> n = cg.variable("n")
    >>> count = While("n", (Call(cg.Graph([n], {"n": n - 1.0}), ("n",), ("n",)),))
    >>> (turns,) = [each for each in many(Program({"n": 1}, [count], record=["n"])).body if isinstance(each, While)]
    >>> [type(each).__name__ for each in turns.body]  # keep n, a turn, choose, go on?
    ['Map', 'Call', 'Map', 'Call']
    """
    if not isinstance(program, Program):
        raise TypeError(f"program must be a Program, got {type(program).__name__}: {program!r:.60}")
    if all([row_of(each).masked is None for each in program.statements()]):
        return program
    lengths, own = dict(program.registers), ":"
    while any([own in name for name in lengths]):
        own += ":"
    masked = Masked(lengths, own=own)
    masked.run(program.body)
    return replace(program, registers=lengths, body=tuple(masked.statements))
