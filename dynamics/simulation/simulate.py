"""Simulation: the motion of a system from a start, and motions of one model prepared for many starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from typing import Any, Unpack

from numpy.typing import ArrayLike

from cgraph._shared import is_function, or_nearest, require_choice, require_flag, require_sequence

from ..equations.state_equation import FORMS
from ..equations.states.initial_value import other_inputs
from ..systems.model import Model, as_equations
from .applied_force import SampledController, Tau
from .events.event import Event, as_events
from .outcome import InterruptedMotion
from .run import Run
from .run_options import METHOD, Options, Span, Steps, known_options, time_span
from .trajectory import Trajectory


def simulate(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str = METHOD,
    *,
    t_eval: ArrayLike | None = None,
    events: Event | Iterable[Event] = (),
    tau: Tau = 0.0,
    parameters: Mapping[str, float] | None = None,
    **options: Unpack[Options],
) -> Trajectory:
    """The motion of a system from (q, qd) at t0 to t_end.

    It is `prepare` and a call. A step whose state is not finite, or that has to be smaller than the resolution of t,
    ends the run: the state where it stopped is the last row, and `stats.message` and a `SimulationWarning` name the
    time and the coordinate. Ctrl-C does the same, without a warning.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The start, (nq,) and (n,) [rad or m, per second]; of an OdeSystem q is the state, (m,), and qd None. Of the
        quaternions (w, x, y, z) of ball and free joints the direction counts.
    t_end : float
        Where the run ends [s], before t0 for a run back in time.
    method : str
        A name of `dyn.METHODS`. Steps chosen by error: "dop853", "dopri5", and for stiff systems "rodas", "radau";
        equal steps: "rk4", "euler" and the symplectic "verlet", "midpoint", "gauss4", ... "verlet" and
        "symplectic_euler" cannot be with ball and free joints and constraints.
    t_eval : array_like, optional
        Times from the start to t_end to record, (T,) [s]; by default every step. Chosen steps are not changed by it.
    events : Event or iterable of Event
        Instants to look for on the way.
    tau : float, sequence, callable or SampledController
        Applied force [N m or N]: constant, for all velocities or for each, (n,); or a controller. One in closed form is
        a function (q, qd, t) or (q, qd, t, p) to a node or number for each velocity, which is compiled into the steps,
        see `with_controller`. A `SampledController` calls a Python function of numbers once in a period.
    parameters : mapping, optional
        {name: value} in place of the model's own, and of those that a controller in closed form has besides.
    **options
        `t0`, `t_span`, `dt`, `rtol`, `atol`, `dense_output` and more: see `dyn.Options`.

    Returns
    -------
    Trajectory
        t (T,), q (T, nq), qd (T, n), energy (T,), events, and `stats` on how the run went.

    Raises
    ------
    TypeError, ValueError
        For arguments of another type, shape or range, each by name.
    SingularMassMatrixError
        For a coordinate without inertia.
    MemoryError
        Where the rows would not fit.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.planar_arm([1.0, 0.8], [1.0, 0.8])
    >>> run = dyn.simulate(arm, [1.0, 0.5], [0.0, 0.0], t_end=1.0, method="dop853", t_eval=[0.0, 0.5, 1.0])
    >>> run.q.round(3).tolist()
    [[1.0, 0.5], [0.31, -0.04], [-0.989, 0.108]]
    """
    t0, t_end = time_span(t_end, options.pop("t0", 0.0), options.pop("t_span", None))
    run = _run(model, method, tau, events, options)._bound(parameters)
    try:
        return run._trajectory(q, qd, Span(t_end, t0=t0, t_eval=t_eval), parameters)
    except InterruptedMotion as stop:
        return stop.run


def prepare(
    model: Model,
    method: str = METHOD,
    *,
    events: Event | Iterable[Event] = (),
    tau: Tau = 0.0,
    varied: str | Iterable[str] = (),
    **options: Unpack[Options],
) -> Run:
    """A model, a method and its options, fixed once for many motions.

    Parameters
    ----------
    model, method, events, tau
        As of `simulate`, which is this and a call.
    varied : str or iterable of str
        Parameters of the model or of a controller whose values stay open. Values of others are built into the machine
        code, and other ones compile anew. Not with a SampledController.
    **options
        See `dyn.Options`; `t0` and `t_span` belong to a call.

    Returns
    -------
    Run
        `motion(q, qd, t_end)` gives the trajectory of `simulate`, `motion.end(q, qd, t_end)` its end alone, and
        `motion.start(q, qd)` the motion step by step. Its machine code is made here; rows between steps (`t_eval`) and
        other values of parameters that are not `varied` compile at the first call with them.

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
    run = _run(model, method, tau, events, options, varied)
    with suppress(Exception):  # what is wrong with the model is said by a call, which may bring the numbers it lacks
        run.compile()
    return run


def _run(model: Model, method: str, tau: Tau, events: Any, options: Mapping[str, Any], varied: Any = ()) -> Run:
    """A run of any span, its arguments checked, not compiled."""
    plain = {name: value for name, value in options.items() if name not in ("form", "dense_output")}
    form, dense = options.get("form", FORMS[0]), require_flag("dense_output", options.get("dense_output", False))
    equations = as_equations(model)
    require_choice("form", form, FORMS)
    names = require_sequence("varied", [varied] if isinstance(varied, str) else varied, "names of parameters", str)
    steps, sampled = Steps(method, **known_options(plain)), isinstance(tau, SampledController)
    if names and sampled:
        raise ValueError(f"varied = {names} cannot be with a SampledController, which holds its forces")
    if unknown := [name for name in names if name not in equations.parameters and not is_function(tau)]:
        known = or_nearest(unknown[0], list(equations.parameters))
        raise ValueError(f"varied: the system has no parameter {unknown[0]!r:.80}; {known}")
    if steps.estimate_error and sampled:
        raise ValueError("estimate_error cannot be with a SampledController: run again with half of dt and compare")
    if not (sampled or is_function(tau) or isinstance(tau, float)):  # a number is checked with the start
        other_inputs(equations, tau)
    return Run(model, steps, tau, as_events(events), form, dense, names)
