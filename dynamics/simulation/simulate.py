"""Simulation: the motion of a system from a start, and motions of one model prepared for many starts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress

from numpy.typing import ArrayLike

from cgraph._shared import require_choice, require_flag, require_sequence

from ..equations.state_equation import FORMS
from ..equations.states.initial_value import other_inputs
from ..systems.model import Model, as_equations
from .events.event import Event, as_events
from .moving import Tau, check_varied
from .outcome import InterruptedMotion
from .prepared_motion import PreparedMotion
from .run_options import METHOD, RunOptions, time_span
from .sampled_controller import SampledController
from .trajectory import Trajectory

ANY = 1.0  # s: the span of options, in place of which each run has its own


def simulate(
    model: Model,
    q: ArrayLike,
    qd: ArrayLike | None,
    t_end: float | None = None,
    method: str = METHOD,
    *,
    t0: float = 0.0,
    t_span: ArrayLike | None = None,
    dt: float | None = None,
    max_step: float | None = None,
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    t_eval: ArrayLike | None = None,
    events: Event | Iterable[Event] = (),
    dense_output: bool = False,
    tau: Tau = 0.0,
    parameters: Mapping[str, float] | None = None,
    first_step: float | None = None,
    max_steps: float = math.inf,
    estimate_error: bool | None = None,
    backend: str = "auto",
    fma: bool = True,
    progress: bool | None = None,
    form: str = "velocity",
) -> Trajectory:
    """The motion of a system from (q, qd) at t0 to t_end.

    It is `prepare` and a call: what moves a model again and again prepares it once.

    A step whose state is not finite, or that has to be smaller than the resolution of t, ends the run: the trajectory
    keeps what was computed before it, the state where it stopped is its last row, and `stats.message` and a
    `SimulationWarning` name the time and the coordinate. Ctrl-C does the same, without a warning.

    Parameters
    ----------
    model : System, OdeSystem, Mechanism or Scene
        What moves.
    q, qd : array_like
        The start, (nq,) and (n,) [rad or m, per second]; of an OdeSystem q is the state, (m,), and qd None. There are
        as many coordinates as velocities but with ball and free joints, whose quaternions (w, x, y, z) are brought to
        length 1: only their direction counts.
    t_end : float
        Where the run ends [s], before t0 for a run back in time.
    method : str
        A name of `dyn.METHODS`. Steps chosen by error: "dop853", "dopri5", and for stiff systems "rodas", "radau";
        equal steps: "rk4", "euler" and the symplectic "verlet", "midpoint", "gauss4", ... With ball and free joints and
        constraints the symplectic ones step the state, which keeps what is quadratic in it, as a free rotor's energy;
        "verlet" and "symplectic_euler" cannot.
    t0 : float
        Where the run starts [s].
    t_span : array_like, optional
        (t0, t_end), as in SciPy, in place of the two.
    dt : float, optional
        The largest of equal steps [s], 1e-3 by default: the steps between two recorded times are equal, so that the
        last row is at t_end exactly.
    max_step : float, optional
        The longest of chosen steps [s]; no limit by default.
    rtol, atol : float, float or array_like, optional
        The error of a chosen step, relative to each component of the state, and absolute: one number for all, or (m,),
        one for each of q and then qd. By default 1e-9, and for atol rtol times the largest value that the
        component has had so far, or a ten-thousandth of the largest coordinate or velocity, in whatever unit: of a
        mechanism an angle counts as the way that it moves its bodies by. All entries of a quaternion are as large as 1.
        A jump of a force in time is passed then, as well as a hundredth of the longest of the last steps allows. Of
        equal steps the estimated error that is no cause of a warning, relative to the largest of a component over the
        run; 1e-3 and 0 by default.
    t_eval : array_like, optional
        Times from t0 to t_end to record, in this order, (T,) [s]; by default every step. Chosen steps are not changed
        by it.
    events : Event or iterable of Event
        Instants to look for on the way.
    dense_output : bool
        Whether to keep what lies between the rows, for `Trajectory.solution(t)`: some numbers a step for every one of
        the state.
    tau : float, sequence, callable or SampledController
        Applied force [N m or N]: constant, for all velocities or for each, (n,); or a controller. One in closed form is
        a function (q, qd, t) or (q, qd, t, p) to a node or number for each velocity, which is compiled into the steps,
        see `with_controller`. A `SampledController` calls a Python function of numbers once in a period; equal steps
        then have their error estimated by steps of half the length, period by period.
    parameters : mapping, optional
        {name: value} in place of the model's own, and of those that a controller in closed form has besides.
    first_step : float, optional
        In place of the first step that the method chooses [s].
    max_steps : float
        Trials of steps, rejected ones too, after which the run stops.
    estimate_error : bool, optional
        Of equal steps, whether runs beside, of steps two and four times as long, estimate their error
        (`Stats.error`), which takes three quarters as long again; by default they do. The rows are the same without.
    backend : str
        "llvm", "python", or "auto" for machine code where llvmlite is installed; the steps are the same.
    fma : bool
        Whether the steps may fuse a product and a sum where the processor can, as in `cgraph.compile`. Without they
        have the bits that they have in Python, in C and on any other machine with the same C library.
    progress : bool, optional
        A progress line on standard error; None shows it on a terminal, for runs over a second.
    form : {"velocity", "momentum"}
        What the steps are of: q and qd, or q and the momenta p = dL/dqd by Hamilton's equations, on which symplectic
        methods then act as they are written. Events, controllers, rows and dense output are in q and qd all the same,
        and the rows have p besides; `atol` of (m,) is for q and then p. Not with constraints.

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
    t0, t_end = time_span(t_end, t0, t_span)
    chosen = (dt, max_step, rtol, atol, None, first_step, max_steps, backend, progress, 0.0, estimate_error, fma)
    motion = motion_of(model, RunOptions(ANY, method, *chosen), tau, events, form, dense_output)
    try:
        return motion(q, qd, t_end, t0, t_eval=t_eval, parameters=parameters)
    except InterruptedMotion as stop:
        return stop.run


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
        SampledController. With a controller that is a function the first call checks the names.

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
    check_varied(equations, tau, names)
    dense_output = require_flag("dense_output", dense_output)
    return PreparedMotion(model, options, tau, as_events(events), form, dense_output, names)
