"""Method: one integrator, as the program that makes its steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cgraph.extend import Program

from .problem import Problem
from .step import Step

ROUNDING = 16.0 * 2.0**-52  # of the sums of a step


@dataclass(frozen=True)
class Method:
    """An integrator: what `dyn.METHODS` holds, and all that a simulation knows of a method.

    A method is a function from a problem, xdot = f(x, t, p) as graphs, to a program: graphs called one after another
    over named registers of float64, which is compiled once and then repeated natively. It holds no state of a run and
    never calls Python. An explicit Runge-Kutta method needs no code: it is a row of `tableau.TABLEAUS`.

    Parameters
    ----------
    order : int
        p, where the error of a run falls as h^p.
    program : callable
        program(problem, dense), the steps as a program. It reads `problem.rate`, and what `time_derivative` and
        `mechanics` derive; `jacobian_statements` are those for the Jacobian of the rate. What the program has to keep
        to depends on `adaptive`; m is the size of a state.
    adaptive : bool
        Whether the method chooses its steps by an estimate of their error.
    degree : int
        Of the dense output, 0 where there is none.
    finest : float
        The relative tolerance below which a step's own rounding is larger.
    starts : bool
        Whether the first step needs no search, since a step is at most what the derivatives at its start allow.
    step : callable, optional
        step(problem), one step of a size that is handed in, see `Step`: what derivatives of motions are taken of.

    A program of equal steps makes one step in a pass. Before each pass its registers (`explicit.registers`) hold

    ======================  =========================================================================================
    x (m), p                the state, and the values of the problem's parameters
    t, start, count, h      the time start + count h, where the steps start, how many are done, and the step [s]
    evaluations             of the rate, so far
    nonfinite               0; the run ends when a pass leaves another number
    fresh                   1 before the first pass, where the program has this register
    singular                where the program has it, and after a pass that failed: 0, or 1 + the index of a
                            coordinate without inertia
    ======================  =========================================================================================

    and after it the next state in x, with t, count and evaluations advanced (`explicit.advance` does all but x). It
    records t and x. Where a model's coordinates have a constraint, as quaternions have, the simulation adds to a pass
    that x is brought back to it; a method knows nothing of that.

    An adaptive program makes one trial of a step in a pass. Besides x, p, t and evaluations its registers
    (`step_control.registers`) hold

    ======================  =========================================================================================
    h, tried, next          the step (negative back in time), the size tried and the one to try next [s]; `trial()`
                            sets h and tried, `control()` sets next
    max_step, min_step, end the longest step, the shortest, and where to stop [s]
    rtol, atol (m)          the tolerance, rtol |x| + atol
    jump, longest, still    how steps pass jumps in time, and go on from rest: see `step_control`
    x_new (m), error        where the trial arrived, and its estimated error, 1 at the tolerance (`measured`)
    accepted, rejected      1 or 0 after a trial, and how many were 0
    held                    accepted steps at the stability limit, where the method counts them
    status                  RUNNING, DONE, or TOO_SMALL: the program stops when it is not RUNNING
    t_old, x_old (m)        of the last accepted step, which `accept_step` makes the state
    dense1, .. (m)          with `dense`: x(t_old + s h) = x_old + sum_k dense_k s^k, for k up to `degree`
    ======================  =========================================================================================

    It records `step_control.recorded(dense, degree)` of each accepted step.
    """

    order: int
    program: Callable[[Problem, bool], Program]
    adaptive: bool
    degree: int = 0
    finest: float = ROUNDING
    starts: bool = False
    step: Callable[[Problem], Step] | None = None

    def __repr__(self) -> str:
        return f"<Method of order {self.order}, {'steps by error' if self.adaptive else 'equal steps'}>"
