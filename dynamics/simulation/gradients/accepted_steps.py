"""Accepted steps: a motion run as `simulate` runs it, for the steps and events of which there are to be derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from cgraph.extend import Array

from ...integrators import Problem
from ..estimates.advice import advise
from ..events.event import Event
from ..events.event_program import event_program
from ..missed_momenta import missed_momenta
from ..recorder import Recorder
from ..row_values import converted
from ..run_options import RunOptions
from ..steps.integration import integration_of


class AcceptedSteps(NamedTuple):
    """How a motion went.

    t: (T,), the start, the ends of the steps, and an instant twice where an event resets the state.
    events: by their names, the instants where they happened.  ended: whether one ended the motion.
    status: why it stopped before its end, or empty.  said: what speaks against it, a sentence each.
    """

    t: Array
    events: Mapping[str, Array]
    ended: bool
    status: str
    said: tuple[str, ...]


def accepted_steps(
    problem: Problem, options: RunOptions, events: Sequence[Event], start: Array, parameters: Array
) -> AcceptedSteps:
    """The motion from a start (q, qd), with values of the parameters of the problem. Ctrl-C is KeyboardInterrupt."""
    program = event_program(problem, events) if events else None
    made = partial(integration_of, problem, parameters=parameters.tolist(), events=program, between=bool(events))
    x = converted(problem.momentum, options.t0, start, parameters)
    run, recorder = made(options), Recorder(x, None, options.t0, options.direction)
    with np.errstate(all="ignore"):
        for block in run.blocks(x):
            recorder.add(block)
    advise(run, recorder.last, options, x, made)
    t, rows = recorder.table()
    found = {name: each.t for name, each in run.crossings(problem.nq, parameters).items()}
    missed = missed_momenta(problem, t, rows, parameters, start=(options.t0, start, x))
    return AcceptedSteps(t, found, bool(run.event), run.status, (*run.warnings, *missed))
