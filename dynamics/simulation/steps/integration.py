"""The integration of a problem by a method, and of a compiled program of steps, equal or chosen ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from ...integrators import METHODS, Problem
from ..run_options import RunOptions
from ..sampled_controller import Hold
from .chosen_steps import AdaptiveIntegration
from .step_program import CompiledSteps, compile_steps, step_program
from .stepping import FixedStepIntegration, Integration

if TYPE_CHECKING:
    from ..events.event_program import EventProgram


def integration_of(
    problem: Problem,
    options: RunOptions,
    parameters: Sequence[float] = (),
    hold: Hold | None = None,
    *,
    events: EventProgram | None,
    between: bool,
) -> Integration:
    """A run of a problem, before its first step. between: with all steps, and the dense output of chosen ones."""
    if (name := options.scipy_solver) is not None:
        from .scipy_solvers import ScipyIntegration, scipy_solver

        leg = partial(ScipyIntegration, scipy_solver(problem, name, options.backend), between=between)
        return leg(options) if events is None else _watched(leg, options, events)
    method = METHODS[options.method]
    program = step_program(problem, method, dense=method.adaptive and (between or options.times is not None))
    compiled = compile_steps(program, options.backend)
    return integration(compiled, options, parameters, control=hold, every_step=between, events=events)


def integration(
    compiled: CompiledSteps,
    options: RunOptions,
    parameters: Sequence[float] = (),
    stopped: Callable[[], bool] = lambda: False,
    control: Hold | None = None,
    *,
    every_step: bool = False,
    events: EventProgram | None = None,
) -> Integration:
    """A run, before its first step.  every_step: of equal steps, keep those between times of t_eval too."""
    if events is not None:
        leg = partial(integration, compiled, parameters=parameters, stopped=stopped, control=control, every_step=True)
        return _watched(leg, options, events)
    if compiled.program.adaptive:
        return AdaptiveIntegration(compiled, options, parameters, stopped, control)
    every_step = every_step or options.times is None or options.estimated
    return FixedStepIntegration(compiled, options, parameters, stopped, control, every_step=every_step)


def _watched(leg: Callable[[RunOptions], Integration], options: RunOptions, events: EventProgram) -> Integration:
    """A run with events; without them what watches is not loaded."""
    from ..events.event_log import EventLog, WatchedIntegration

    return WatchedIntegration(leg, options, EventLog(events))
