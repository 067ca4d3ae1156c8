"""StepProgram: the steps of a method on the graphs of a problem, as plain data that pickles; and its compiled form."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from functools import lru_cache

from cgraph import Graph
from cgraph.extend import Factor, Program, Runner, runner

from ..integrators import Method, Problem

KEPT = 16  # programs that stay ready for another run


@dataclass(frozen=True, eq=False)
class StepProgram:
    """What a run reads of a problem and a method."""

    components: tuple[str, ...]  # of the state, in words
    parameters: tuple[str, ...]  # inputs that are not built in
    steps: Program
    rate: Graph | None  # for a method that chooses its steps
    order: int
    adaptive: bool
    dense: bool  # whether its record has dense output
    finest: float  # relative tolerance
    starts: bool  # with a first step that the method chooses
    kinds: tuple[int, ...]  # of the components: coordinates 0, velocities 1; those of an OdeSystem differ

    @property
    def factorizations(self) -> int:
        """LU factorizations in a trial of a step."""
        return sum(isinstance(statement, Factor) for statement in self.steps.statements())

    @property
    def size(self) -> int:
        """Numbers in a state."""
        return len(self.components)


@dataclass(frozen=True, eq=False)
class CompiledSteps:
    """A step program and its machine code, or Python."""

    program: StepProgram
    runner: Runner


@lru_cache(KEPT)
def step_program(problem: Problem, method: Method, *, dense: bool) -> StepProgram:
    """The steps of a method on a problem, all graphs that they need derived; of the last few, those written before.

    dense: whether a method that chooses its steps records its dense output.
    Raises SingularMassMatrixError for a coordinate without inertia, ValueError for a method that the model has not.
    """
    n = problem.size // 2
    return StepProgram(
        problem.components,
        problem.parameters,
        method.program(problem, dense),
        problem.rate if method.adaptive else None,
        method.order,
        method.adaptive,
        dense and method.adaptive,
        method.finest,
        method.starts,
        tuple(range(problem.size)) if problem.system is None else (0,) * n + (1,) * n,
    )


@lru_cache(KEPT)
def pickled_steps(program: StepProgram) -> bytes:
    """The steps as other processes are sent them; of the last few, those pickled before."""
    return pickle.dumps(program)


@lru_cache(KEPT)
def compile_steps(program: StepProgram, backend: str) -> CompiledSteps:
    """The steps, ready to run; of the last few, those compiled before."""
    return CompiledSteps(program, runner(program.steps, backend))
