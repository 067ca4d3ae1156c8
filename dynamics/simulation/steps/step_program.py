"""StepProgram: the steps of a method on the graphs of a problem, as plain data that pickles; and its compiled form."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from cgraph import Graph
from cgraph._shared import Array, kept_by_first, memo
from cgraph.extend import Call, Factor, If, Program, Runner, Statement, runner

from ...integrators import Method, Problem
from ...integrators.problem import constraint_rates
from ...integrators.step_control import projected
from .dense_output import StepBlock
from .first_step import with_first_step
from .state_sizes import StateKinds, state_kinds, with_floor

KEPT = 8  # programs from elsewhere that a process keeps ready


@dataclass(frozen=True, eq=False)
class StepProgram:
    """Program of a problem's steps by a method, as a run reads it."""

    components: tuple[str, ...]  # of the state, in words
    parameters: tuple[str, ...]  # inputs that are not built in
    steps: Program
    rate: Graph
    timed: bool  # whether it depends on t
    order: int
    adaptive: bool
    dense: bool  # whether its record has dense output
    finest: float  # relative tolerance
    kinds: StateKinds
    normalization: Graph | None  # between steps, see Problem; with constraints and no parameters their projection
    nq: int  # coordinates in a state, which come first
    rows: Graph | None  # of chosen steps: see `constraint_rates`

    @property
    def size(self) -> int:
        """Numbers in a state."""
        return len(self.components)

    def block(self, rows: Array) -> StepBlock:
        """Rows of chosen steps as these."""
        m = self.size
        t, h, x = rows[:, 0], rows[:, 1], rows[:, 2 : 2 + m]
        if not self.dense:
            return StepBlock(t, x, t - h, h, np.full_like(x, np.nan), None)
        t_old, x_old, dense = rows[:, 2 + m], rows[:, 3 + m : 3 + 2 * m], rows[:, 3 + 2 * m :]
        return StepBlock(t, x, t_old, h, x_old, dense.reshape(len(t), -1, m), self.normalization)

    def __reduce__(self) -> tuple[Any, ...]:
        return _arrived, (_pickled(self),)


@dataclass(frozen=True, eq=False)
class CompiledSteps:
    """A step program and its machine code, or Python."""

    program: StepProgram
    runner: Runner

    @cached_property
    def places(self) -> dict[str, int]:
        """Where in a memory the registers of one number are."""
        numbers = np.arange(float(self.runner.size))
        steps = self.program.steps
        single = [name for name, length in steps.registers.items() if length == 1 and name not in steps.shared]
        return {name: int(self.runner.read(numbers, name)[0]) for name in single}

    @cached_property
    def factorizations(self) -> int:
        """LU factorizations in a trial of a step."""
        return sum(isinstance(statement, Factor) for statement in self.program.steps.statements())


@kept_by_first
def step_program(problem: Problem, method: Method, *, dense: bool) -> StepProgram:
    """The steps of a method on a problem, all graphs derived; the problem keeps them.  dense: with dense output."""
    steps, kinds = _normalized(method.program(problem, dense), problem, method), state_kinds(problem)
    if method.adaptive:
        kinds = with_floor(kinds, problem)
        steps = with_first_step(steps, problem, kinds, method.order, starts=method.starts)
    return StepProgram(
        problem.components,
        problem.parameters,
        steps,
        problem.rate,
        problem.timed,
        method.order,
        method.adaptive,
        dense and method.adaptive,
        method.finest,
        kinds,
        problem.normalization if problem.projection is None or problem.parameters else problem.projection,
        problem.nq,
        constraint_rates(problem) if method.adaptive else None,
    )


@kept_by_first
def slide_program(plain: StepProgram, problem: Problem, method: Method) -> StepProgram:
    """The steps of a problem that slides on surfaces of that of other steps."""
    steps = _normalized(method.program(problem, dense=True), problem, method)
    if method.adaptive:
        steps = with_first_step(steps, problem, plain.kinds, method.order, starts=method.starts)
    return replace(plain, steps=steps, rate=problem.rate, timed=problem.timed)


def _normalized(steps: Program, problem: Problem, method: Method) -> Program:
    """The steps, which normalize or project where they arrive; `farthest` tells how far, in tolerances."""
    if problem.projection is not None and method.adaptive:
        lengths = {**steps.registers, "onto": problem.size, "way": 1, "farthest": 1}
        onto = Call(problem.projection, ("x", "t", "p"), ("onto",))
        return replace(steps, registers=lengths, body=[*steps.body, If("accepted", (onto, *projected(problem.size)))])
    arrived = normalizing(problem, "t")
    body: list[Statement] = [If("accepted", tuple(arrived))] if arrived and method.adaptive else arrived
    return replace(steps, body=[*steps.body, *body])


def normalizing(problem: Problem, time: str) -> list[Statement]:
    """Statements that make register x, a state that a step arrives at, meet its constraints at an instant."""
    if problem.projection is not None:
        return [Call(problem.projection, ("x", time, "p"), ("x",))]
    return [] if problem.normalization is None else [Call(problem.normalization, ("x",), ("x",))]


@kept_by_first
def _pickled(program: StepProgram) -> bytes:
    """The steps as other processes are sent them."""
    return pickle.dumps([getattr(program, each.name) for each in fields(program)])


@memo(KEPT)
def _arrived(pickled: bytes) -> StepProgram:
    """The steps in another process: what comes again is the same, with what is compiled of it."""
    return StepProgram(*pickle.loads(pickled))  # noqa: S301  # it came with the task itself


@kept_by_first
def compile_steps(program: StepProgram, backend: str, fma: bool) -> CompiledSteps:
    """The steps, ready to run."""
    run = runner(program.steps, backend, fma=fma)
    run.run(run.memory({}), 0)  # makes the code that a motion runs
    return CompiledSteps(program, run)
