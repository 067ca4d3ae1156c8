"""The integration of a compiled program of steps, equal or chosen ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .chosen_steps import AdaptiveIntegration
from .run_options import RunOptions
from .sampled_controller import Hold
from .step_program import CompiledSteps
from .stepping import FixedStepIntegration, NativeIntegration


def integration(
    compiled: CompiledSteps,
    options: RunOptions,
    parameters: Sequence[float] = (),
    stopped: Callable[[], bool] = lambda: False,
    control: Hold | None = None,
    *,
    every_step: bool = False,
) -> NativeIntegration:
    """A run, before its first step.  every_step: of equal steps, keep those between times of t_eval too."""
    if compiled.program.adaptive:
        return AdaptiveIntegration(compiled, options, parameters, stopped, control)
    every_step = every_step or options.times is None or options.estimated
    return FixedStepIntegration(compiled, options, parameters, stopped, control, every_step=every_step)
