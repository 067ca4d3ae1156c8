"""The integration of a problem by a method, and of a compiled program of steps, equal or chosen ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from ...integrators import Problem
from ..run_options import RunOptions
from ..sampled_controller import Hold
from .chosen_steps import AdaptiveIntegration
from .step_program import compile_steps, step_program
from .stepping import FixedStepIntegration, Integration, NativeRun

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

        segment = partial(ScipyIntegration, scipy_solver(problem, name, options.backend), between=between)
        return segment(options) if events is None else _watched(segment, options, events)
    method = options.integrator
    program = step_program(problem, method, dense=method.adaptive and (between or options.between))
    run = NativeRun(compile_steps(program, options.backend), options, parameters, control=hold)
    return integration(run, every_step=between, events=events)


def integration(run: NativeRun, *, every_step: bool = False, events: EventProgram | None = None) -> Integration:
    """A run, before its first step.  every_step: of equal steps, keep those between times of t_eval too."""
    options = run.options
    if events is not None:
        return _watched(lambda segment: integration(run._replace(options=segment), every_step=True), options, events)
    if run.compiled.program.adaptive:
        return AdaptiveIntegration(run)
    return FixedStepIntegration(run, every_step=every_step or options.times is None or options.estimated)


def _watched(segment: Callable[[RunOptions], Integration], options: RunOptions, events: EventProgram) -> Integration:
    """A run with events; without them what watches is not loaded."""
    from ..events.event_log import WatchedIntegration

    return WatchedIntegration(segment, options, events)
