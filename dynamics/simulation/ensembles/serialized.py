"""Portable: a problem and a method as graphs and names alone, which pickle, unlike a model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from cgraph import Graph
from cgraph.extend import Factor, If, Program, Solve, While

from ...integrators import Method, Problem


class Coordinates(NamedTuple):
    """What a run says of a mechanical system."""

    coordinates: tuple[str, ...]

    @property
    def n(self) -> int:
        """Their number."""
        return len(self.coordinates)


class Straight(NamedTuple):
    """A program without a course that depends on numbers: what is done once, before the first pass, and a pass."""

    start: Program | None
    one_pass: Program


@dataclass(frozen=True, eq=False)
class Portable:
    """What a run reads of its Problem and its Method, in place of both."""

    states: tuple[str, ...]
    parameters: tuple[str, ...]
    system: Coordinates | None  # None: of first order
    steps: Program
    rate: Graph | None  # for a method that chooses its steps
    order: int
    adaptive: bool
    degree: int

    @property
    def size(self) -> int:
        """Numbers in a state."""
        return len(self.states)

    def component(self, index: int) -> str:
        """A component of the state, in words."""
        if self.system is None:
            return f"state {self.states[index]!r}"
        what = "coordinate" if index < self.system.n else "velocity of"
        return f"{what} {self.system.coordinates[index % self.system.n]!r}"

    def program(self, problem: object, dense: bool) -> Program:
        """As a Method has it; dense output is in it."""
        return self.steps

    def straight(self) -> Straight | None:
        """The program for many at once; None if its course depends on numbers.

        That a run ends when it has left the numbers (register `lost`) is left out: the others go on.
        """
        first, body, start = self.steps.body[0], self.steps.body, None
        if isinstance(first, If) and first.register == "fresh" and not first.otherwise:
            start, body = replace(self.steps, body=first.body, stop=None), body[1:]
        one_pass = replace(self.steps, body=body, stop=None)
        statements = [*one_pass.statements(), *(start.statements() if start else ())]
        if self.steps.record_if is not None or any(
            isinstance(each, While | If | Factor | Solve) for each in statements
        ):
            return None
        return Straight(start, one_pass)


def portable(problem: Problem, method: Method) -> Portable:
    """What has to be sent of a problem and a method.

    Raises SingularMassMatrixError for a coordinate without inertia, ValueError for a method that the model has not.
    """
    names = None if problem.system is None else Coordinates(problem.system.coordinates)
    return Portable(
        problem.states,
        problem.parameters,
        names,
        method.program(problem, True),
        problem.rate if method.adaptive else None,
        method.order,
        method.adaptive,
        method.degree,
    )
