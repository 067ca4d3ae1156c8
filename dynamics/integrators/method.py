"""Method: one integrator, as the step that it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cgraph as cg
from cgraph import Node
from cgraph._shared import memo
from cgraph.extend import Program

from .problem import Problem
from .step import Step, Values, arriving, call, rate_calls, with_registers
from .step_control import HERMITE, chosen, first_pass, nonfinite

KEPT_METHODS = 32  # methods of an order
SUM_ROUNDING = 16.0 * 2.0**-52  # of the sums of a step


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
        derivatives at its start allow: `prepare`, which comes before every trial, makes `next` no larger. After a trial
        that was too long all begins again, with `start`.

    order_at : callable, optional
        Of a method whose order goes by the relative tolerance: the order for one, at most `order`. The step is then
        step(problem, order=..).

    A run of equal steps makes one in a pass. Before each pass the registers hold

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
    at_limit                accepted steps at the stability limit, where the step counts them
    status                  RUNNING, DONE, or TOO_SMALL: the run stops when it is not RUNNING
    t_old, x_old (m)        of the last accepted step
    dense1, .. (m)          with dense output: x(t_old + s h) = x_old + sum_k dense_k s^k, for k up to `degree`
    ======================  =========================================================================================

    It records `step_control.recorded(dense, degree)` of each accepted step.
    """

    order: int
    step: Callable[..., Step]
    adaptive: bool = False
    degree: int = HERMITE
    finest: float = SUM_ROUNDING
    starts: bool = False
    order_at: Callable[[float], int] | None = None

    def at(self, rtol: float) -> Method:
        """The method for runs of a relative tolerance, of the order that this asks for.

        >>> from dynamics.integrators import METHODS
        >>> METHODS["taylor"].at(1e-9), METHODS["taylor"].at(1e-12)
        (<Method of order 14, steps by error>, <Method of order 17, steps by error>)
        """
        return self if self.order_at is None else _of_order(self, self.order_at(rtol))

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


@memo(KEPT_METHODS)
def _of_order(method: Method, order: int) -> Method:
    """The method of one order; the same object for the same, since problems keep programs by it."""
    step = partial(method.step, order=order)
    return replace(method, order=order, degree=order, step=step, order_at=None)


def equal_registers(problem: Problem) -> dict[str, int]:
    """Registers of every program of equal steps."""
    single = dict.fromkeys(("t", "h", "start", "count", "evaluations", "nonfinite"), 1)
    return {"x": problem.size, "x_new": problem.size, "p": len(problem.parameters), **single}


def equal(step: Step, problem: Problem) -> Program:
    """Equal steps: one step a pass, of a length that is given, over and over."""
    lengths = with_registers(step, equal_registers(problem))
    made = float(rate_calls(problem, step.rates, step.prepare, step.body))

    def ended(start: Node, count: Node, h: Node, evaluations: Node) -> Values:
        """The next time, computed from the start without drift."""
        return {"t": start + (count + 1.0) * h, "count": count + 1.0, "evaluations": evaluations + made}

    def failed(nonfinite: Node, failed: Node, *singular: Node) -> Values:
        """Of what goes on, an inertia that is negative says nothing."""
        bad = nonfinite + failed
        kept = {"singular": cg.where(bad, singular[0], 0.0)} if singular else {}
        return {"nonfinite": bad, step.failed: 0.0, **kept}

    body = [*arriving([*step.rates, *step.prepare, *step.body, *step.kept]), call(ended), nonfinite("nonfinite", "x")]
    if step.failed:
        body.append(call(failed, "nonfinite", step.failed, *(["singular"] if "singular" in lengths else [])))
    if step.start:
        body.insert(0, first_pass(*step.start))
        lengths["fresh"] = 1
    return Program(lengths, body, record=["t", "x"], stop="nonfinite")
