"""`program_jvp`, `program_vjp`: derivatives of a whole run of a program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import GraphError
from ...core.evaluation import Array, real_array
from ...util.require import require_mapping, require_whole
from ..program import Program
from ..runners.choose_runner import runner
from ..runners.runner import Runner
from .linearization import TURNS, Linearization, Linearized, require_program
from .tape import Tape

TAPE_BLOCK = 4096  # passes in a block of a tape


def program_jvp(program: Program, wrt: Sequence[str] = (), *, constant: Sequence[str] = ()) -> Linearized:
    """A program with the tangents of its registers: J x_dot of any number of passes.

    Every register that is recorded or handed on, and every one of `wrt`, has a register "{name}:dot" for its tangent,
    which is set before the first pass and read after the last one: `vectors` of the result. Its record has the rows of
    the program's, then the tangents of what has tangents in them. Values and tangents are computed side by side; a loop
    turns as often as its values say, and a `FixedPoint` has the tangent of its equations.

    program: without `record_if` and `stop`.  wrt: registers that passes read and do not write, or are fed; those that
    passes hand on come with them.  constant: registers whose values have no derivatives, such as guesses.
    Raises GraphError for an unknown register, TypeError for a statement without derivative.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, program_jvp, runner
    >>> x = cg.variable("x")
    >>> square = Program({"x": 1}, [Call(cg.Graph([x], {"x": x * x}), ("x",), ("x",))], record=["x"])
    >>> moved = program_jvp(square)
    >>> run = runner(moved.program)
    >>> run.run(run.memory({"x": 3.0, moved.vectors["x"]: 1.0}), passes=2).rows.tolist()
    [[9.0, 6.0], [81.0, 108.0]]
    """
    require_program(program)
    passes = _linearization(program, program.record, wrt, constant, TURNS)
    return passes.beside(list(wrt), program.record)


class Pulled(NamedTuple):
    """Values at the end of passes, and cotangents at their start.

    values: {register of `of`: its value after the last pass}.  bars: {register: its cotangent} of what is handed on and
    of `wrt`.  rows: {register of the feed in `wrt`: its cotangents, (passes, length)}.

    >>> from cgraph.extend import Program, program_vjp
    >>> program_vjp(Program({"x": 1}, [], record=()), ["x"])({"x": 2.0}, 1, {"x": 3.0}).bars
    {'x': array([3.])}
    """

    values: dict[str, Array]
    bars: dict[str, Array]
    rows: dict[str, Array]


class ProgramVjp:
    """J^T y_bar of any number of passes of a program; made by `program_vjp`.

    forward: runs the passes, which record what their way back reads; what is handed on begins and ends in the registers
    `handed`, {register: the one that has its value after a pass}.  backward: runs a pass backwards, fed a row of that
    record, and has cotangents in the registers `vectors`, {register: that of its cotangent}.

    >>> from cgraph.extend import Program, program_vjp
    >>> pull = program_vjp(Program({"x": 1}, [], record=()), ["x"])
    >>> pull({"x": 2.0}, passes=5, seeds={"x": 3.0}).bars["x"].tolist()
    [3.0]
    """

    def __init__(self, passes: Linearization, of: Sequence[str], backend: str, checkpoints: int) -> None:
        linear = passes.adjoint(of)
        self._passes, self._of, self._checkpoints, self._unsolved = passes, of, checkpoints, linear.unsolved
        self.handed, self.vectors = dict(passes.handed), dict(linear.vectors)
        self.forward: Runner = runner(passes.forward(linear.program.feed, of), backend)
        self.backward: Runner = runner(linear.program, backend)

    def __call__(
        self,
        values: Mapping[str, ArrayLike],
        passes: int,
        seeds: Mapping[str, ArrayLike],
        feed: ArrayLike | None = None,
    ) -> Pulled:
        """Run at least one pass from values of registers, and pull cotangents of `of` back through them.

        values: {register: value before the first pass}, 0 for others.  seeds: {register of `of`: cotangent after the
        last pass}, 0 for others.  feed: (passes, feed_width), as for `Runner.run`.
        Raises GraphError for unknown registers or other shapes, where equations of a `FixedPoint` were not solved, and
        for a loop that takes more turns than there is room for.
        """
        require_whole("passes", passes, 1)
        if unknown := [name for name in require_mapping("seeds", seeds, "register: cotangent") if name not in self._of]:
            raise GraphError(f"seeds must be among {', '.join(self._of)}, got {unknown[0]!r:.60}")
        rows = np.empty((passes, 0)) if feed is None else real_array("feed", feed)
        if feed is not None and len(rows) != passes:
            raise GraphError(f"the feed needs a row for each of {passes} passes, got {len(rows)}")
        known = [name for name in self.forward.program.registers if name not in self.handed.values()]
        if strange := [name for name in require_mapping("values", values, "register: numbers") if name not in known]:
            raise GraphError(f"values must be of registers among {', '.join(known)}, got {strange[0]!r:.60}")
        placed = {
            self.handed.get(name, name): real_array(f"register {name!r}", value) for name, value in values.items()
        }
        memory = self.forward.memory(placed)
        tape = Tape(self.forward, lambda first, last: rows[first:last], self._checkpoints)
        tape.run(memory, 0, passes, TAPE_BLOCK)
        ends = {name: self.forward.read(memory, self.handed.get(name, name)).copy() for name in self._of}
        kept = {name: self.forward.read(memory, name) for name in self._passes.constants}
        same = {name: value for name, value in kept.items() if name in self.backward.program.registers}
        bars = {self.vectors[name]: real_array(f"the seed of {name!r}", value) for name, value in seeds.items()}
        back = self.backward.memory({**same, **bars})
        width, parts = self.backward.program.feed_width, []
        for first, last, record in tape.recorded(backwards=True):
            fed = record[::-1, :width] if width else np.empty((last - first, 0))
            parts.append(self.backward.run(back, last - first, 1, fed).rows)
        if np.isnan(unsolved := self.backward.read(back, self._unsolved)[0]):
            raise GraphError(f"a loop took more turns than the {self._passes.turns} there is room for: give turns=")
        if unsolved:
            raise GraphError("the derivative of a FixedPoint was not solved: its turns do not settle")
        bars = {name: self.backward.read(back, register).copy() for name, register in self.vectors.items()}
        slopes, at = (np.concatenate(parts) if self._passes.varied else np.empty((passes, 0)))[::-1], 0
        by_pass = {}
        for name in self._passes.varied:
            length = self.forward.program.registers[name]
            by_pass[name] = slopes[:, at : at + length]
            at += length
        return Pulled(ends, bars, by_pass)


def program_vjp(
    program: Program,
    of: Sequence[str],
    wrt: Sequence[str] = (),
    *,
    constant: Sequence[str] = (),
    turns: int = TURNS,
    checkpoints: int = 0,
    backend: str = "auto",
) -> ProgramVjp:
    """Cotangents through any number of passes of a program: J^T y_bar of what its registers hold after the last one.

    The passes record the results of their heavy graphs and what they begin with; on the way back the rest is computed
    again. A loop inside a pass records its turns on a stack.

    program, wrt, constant: as for `program_jvp`; what it records does not matter.  of: registers whose values after the
    last pass are the result.  turns: for how many turns of a `While` there is room.  checkpoints: keep the memory after
    every so many passes, and record again from there; 0: keep the record of all.
    backend: as for `runner`.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, program_vjp
    >>> x, p = cg.variables("x p")
    >>> step = Program({"x": 1, "p": 1}, [Call(cg.Graph([x, p], {"x": p * x}), ("x", "p"), ("x",))], record=["x"])
    >>> pulled = program_vjp(step, ["x"], ["p"])({"x": 2.0, "p": 3.0}, passes=2, seeds={"x": 1.0})
    >>> pulled.values["x"].tolist(), pulled.bars["x"].tolist(), pulled.bars["p"].tolist()
    ([18.0], [9.0], [12.0])
    """
    require_program(program)
    passes = _linearization(program, of, wrt, constant, turns)
    return ProgramVjp(passes, list(of), backend, require_whole("checkpoints", checkpoints))


def _linearization(
    program: Program, of: Sequence[str], wrt: Sequence[str], constant: Sequence[str], turns: int
) -> Linearization:
    """The program, all of whose passes are run, in single assignment."""
    if controls := [name for name in ("record_if", "stop") if getattr(program, name) is not None]:
        raise GraphError(f"a run has derivatives if it does not depend on numbers how long it is: no {controls[0]}")
    return Linearization(program, of, wrt, constant=constant, turns=turns)
