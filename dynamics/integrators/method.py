"""Method: one integrator, as the program that makes its steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cgraph.extend import Program

from .problem import Problem


@dataclass(frozen=True)
class Method:
    """An integrator.

    order: of its error in the step (of its error in a run).
    program(problem, dense): what makes its steps, one pass a step or a trial of one.
    adaptive: whether it chooses its steps; see `fixed.py` and `adaptive.py` for the registers of each kind.
    degree: of its dense output, 0 where it has none; the program then has registers dense1, .. of polynomial
        coefficients: x(t + s h) = x + sum_k dense_k s^k.
    """

    order: int
    program: Callable[[Problem, bool], Program]
    adaptive: bool
    degree: int = 0
