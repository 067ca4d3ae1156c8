"""Method: one integrator, as the step that it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cgraph.extend import Program

from .equal import equal
from .problem import Problem
from .step import Step
from .step_control import HERMITE, chosen

ROUNDING = 16.0 * 2.0**-52  # of the sums of a step


@dataclass(frozen=True)
class Method:
    """An integrator: what `dyn.METHODS` holds, and all that a simulation knows of a method.

    A method is a function from a problem, xdot = f(x, t, p) as graphs, to a step: statements over named registers of
    float64, graphs called one after another, which are compiled once and then repeated natively. It holds no state of a
    run and never calls Python. Runs by equal steps, by steps that are chosen by their error, and derivatives of motions
    are made of the same step. An explicit Runge-Kutta method needs no code: it is a row of `tableau.TABLEAUS`.

    Parameters
    ----------
    order : int
        p, where the error of a run falls as h^p.
    step : callable
        step(problem), see `Step`. It reads `problem.rate`, and what `time_derivative` and `mechanics` derive;
        `jacobian_statements` are those for the Jacobian of the rate.
    adaptive : bool
        Whether a run chooses its steps by the estimate of their error. Default: steps are equal.
    degree : int
        Of the dense output of chosen steps.
    finest : float
        The relative tolerance below which a step's own rounding is larger.
    starts : bool
        Whether steps need no search for the first, and no limit by the one before, since each is at most what the
        derivatives at its start allow: `prepare` makes `next` no larger.

    A run of equal steps makes one in a pass. Before each pass the registers (`equal.registers`) hold

    ======================  =========================================================================================
    x (m), p                the state, and the values of the problem's parameters
    t, start, count, h      the time start + count h, where the steps start, how many are done, and the step [s]
    evaluations             of the rate, so far
    nonfinite               0; the run ends when a pass leaves another number
    fresh                   1 before the first pass, where the step has a start
    singular                where the step has it, and after a pass that failed: 0, or 1 + the index of a
                            coordinate without inertia
    ======================  =========================================================================================

    and it records t and x. Where a model's coordinates have a constraint, as quaternions have, the simulation adds to a
    pass that x is brought back to it; a method knows nothing of that.

    A run that chooses its steps makes one trial in a pass. Besides x, p, t and evaluations its registers
    (`step_control.registers`) hold

    ======================  =========================================================================================
    h, tried, next          the step (negative back in time), the size tried and the one to try next [s]
    max_step, min_step, end the longest step, the shortest, and where to stop [s]
    rtol, atol (m)          the tolerance, rtol |x| + atol
    jump, longest, still    how steps pass jumps in time, and go on from rest: see `step_control`
    x_new (m), error        where the trial arrived, and its estimated error, 1 at the tolerance (`measured`)
    accepted, rejected      1 or 0 after a trial, and how many were 0
    held                    accepted steps at the stability limit, where the step counts them
    status                  RUNNING, DONE, or TOO_SMALL: the run stops when it is not RUNNING
    t_old, x_old (m)        of the last accepted step
    dense1, .. (m)          with dense output: x(t_old + s h) = x_old + sum_k dense_k s^k, for k up to `degree`
    ======================  =========================================================================================

    It records `step_control.recorded(dense, degree)` of each accepted step.
    """

    order: int
    step: Callable[[Problem], Step]
    adaptive: bool = False
    degree: int = HERMITE
    finest: float = ROUNDING
    starts: bool = False

    def program(self, problem: Problem, dense: bool) -> Program:
        """The steps of a run, one after another; dense: with dense output where they are chosen.

        Raises ValueError for a method that the model has not, and for a step that lacks what the run needs.
        """
        step = self.step(problem)
        if not self.adaptive:
            return equal(step, problem)
        if not step.error or step.estimate < 1:
            raise ValueError("a method that chooses its steps needs their error, `Step.error`, and `Step.estimate`")
        return chosen(step, problem, dense=dense, degree=self.degree, starts=self.starts)

    def __repr__(self) -> str:
        return f"<Method of order {self.order}, {'steps by error' if self.adaptive else 'equal steps'}>"
