"""A motion prepared: a model, a method and options fixed once, for motions from many starts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress

from numpy.typing import ArrayLike

from cgraph.extend import require_choice, require_flag, require_sequence

from ..equations.state_equation import FORMS
from ..equations.states.initial_value import other_inputs
from ..systems.model import Model, as_equations
from .events.event import Event, as_events
from .moving import Tau, check_varied
from .prepared_motion import PreparedMotion
from .run_options import METHOD, RunOptions
from .sampled_controller import SampledController

ANY = 1.0  # s: the span of options, in place of which each run has its own


def prepare(
    model: Model,
    method: str = METHOD,
    *,
    dt: float | None = None,
    max_step: float | None = None,
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    events: Event | Iterable[Event] = (),
    dense_output: bool = False,
    tau: Tau = 0.0,
    first_step: float | None = None,
    max_steps: float = math.inf,
    estimate_error: bool | None = None,
    backend: str = "auto",
    fma: bool = True,
    progress: bool | None = None,
    form: str = "velocity",
    varied: str | Iterable[str] = (),
) -> PreparedMotion:
    """A model, a method and its options, fixed once for many motions.

    Parameters
    ----------
    model, method, dt, max_step, rtol, atol, events, dense_output, tau, first_step, max_steps
        As of `simulate`, which is this and a call.
    estimate_error, backend, fma, progress, form
        As of `simulate`, too.
    varied : str or iterable of str
        Parameters of the model or of a controller whose values stay open, so that those of a call cost nothing. Values
        of others are built into the machine code, as `simulate` does, and other ones compile anew. Not with a
        SampledController, nor SciPy's solvers. With a controller that is a function the first call checks the names.

    Returns
    -------
    PreparedMotion
        `motion(q, qd, t_end)` gives the trajectory of `simulate`, `motion.end(q, qd, t_end)` its end alone, at the
        price of its steps and some microseconds, and `motion.start(q, qd)` the motion step by step. Its machine code is
        made here; rows between steps (`t_eval`) and other values of parameters that are not `varied` compile at the
        first call with them.

    Raises
    ------
    TypeError, ValueError
        As `simulate`, for what is fixed here; what belongs to a start or to parameters is checked with these.

    Examples
    --------
    >>> import dynamics as dyn
    >>> motion = dyn.prepare(dyn.planar_arm([1.0, 0.8], [1.0, 0.8]), "dop853", rtol=1e-10)
    >>> ends = [motion.end([angle, 0.0], [0.0, 0.0], t_end=0.5).q.round(3).tolist() for angle in (0.1, 0.2)]
    >>> ends
    [[0.005, 0.039], [0.011, 0.077]]
    """
    chosen = (dt, max_step, rtol, atol, None, first_step, max_steps, backend, progress, 0.0, estimate_error, fma)
    motion = motion_of(model, RunOptions(ANY, method, *chosen), tau, events, form, dense_output, varied)
    with suppress(Exception):  # what is wrong with the model is said by a call, which may bring the numbers it lacks
        motion.compile()
    return motion


def motion_of(
    model: Model,
    options: RunOptions,
    tau: Tau,
    events: Event | Iterable[Event],
    form: str,
    dense_output: bool,
    varied: str | Iterable[str] = (),
) -> PreparedMotion:
    """A motion by options of any span, its arguments checked, not compiled."""
    equations = as_equations(model)
    require_choice("form", form, FORMS)
    if not (callable(tau) or isinstance(tau, float | SampledController)):
        other_inputs(equations, tau)
    names = require_sequence("varied", [varied] if isinstance(varied, str) else varied, "names of parameters", str)
    check_varied(equations, tau, options, names)
    dense_output = require_flag("dense_output", dense_output)
    return PreparedMotion(model, options, tau, as_events(events), form, dense_output, names)
