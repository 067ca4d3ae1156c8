"""Simulation: the motion of a system from a start, as a Trajectory, in stages."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

from numpy.typing import ArrayLike

from cgraph import Graph
from cgraph.extend import Array, require_flag

from ..equations.states.initial_value import initial_value
from ..integrators import Problem, derive, force, in_form, total_energy
from ..systems.model import Model
from .applied_forces import Applied, Tau, with_applied
from .events.event import Event, as_events
from .events.event_program import event_program
from .outcome import INTERRUPTED, REACHED, Recorder, outcome
from .progress_bar import Progress
from .row_values import converted, unreached_momenta
from .run_options import METHOD, TABLES, RunOptions, room, time_span
from .steps.dense_output import StepBlock
from .steps.integration import integration_of
from .steps.stepping import Integration
from .trajectory import SimulationWarning, Solution, Stats, Trajectory


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
    progress: bool | None = None,
    form: str = "velocity",
) -> Trajectory:
    """The motion of a system from (q, qd) at t0 to t_end.

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
        equal steps: "rk4", "euler" and the symplectic "verlet", "midpoint", "gauss4", ... With SciPy, "scipy:Radau",
        "scipy:BDF", "scipy:LSODA", "scipy:DOP853", "scipy:RK45". With ball and free joints and constraints the
        symplectic ones step the state, which keeps what is quadratic in it, as a free rotor's energy; "verlet" and
        "symplectic_euler" cannot.
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
        A jump of a force in time is passed then, as well as a hundredth of the longest of the last steps allows. For
        SciPy's solvers 1e-10, and a warning where that is more than 1e-4 of the largest component of a kind. Of equal
        steps the estimated error that is no cause of a warning, relative to the largest of a component over
        the run; 1e-3 and 0 by default.
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
        Steps after which the run stops.
    estimate_error : bool, optional
        Of equal steps, whether runs beside, of steps two and four times as long, estimate their error
        (`Stats.error`), which takes three quarters as long again; by default they do. The rows are the same without.
    backend : str
        "llvm", "python", or "auto" for machine code where llvmlite is installed; the steps are the same.
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
    # Check
    t0, t_end = time_span(t_end, t0, t_span)
    arguments = (dt, max_step, rtol, atol, t_eval, first_step, max_steps, backend, progress)
    options = RunOptions(t_end, method, *arguments, t0, estimate_error)
    watched, dense_output = as_events(events), require_flag("dense_output", dense_output)
    model, applied = with_applied(model, tau, parameters)
    start = initial_value(model, q, qd, applied.constant, parameters, t0)
    options.check(start.states)
    options.check_room(len(start.x))

    # Derive the equations, xdot = f(x, t), and the events as graphs; x is (q, qd), or in `stepped` (q, p)
    problem = derive(model, applied.bound(start.bound))
    stepped = in_form(problem, form)
    program = event_program(stepped, watched) if watched else None
    hold = applied.hold(options, stepped)

    # Write the steps of the method over these graphs, and compile them
    made = partial(integration_of, stepped, events=program, between=bool(watched) or dense_output)
    run, x = made(options, hold=hold), converted(stepped.momentum, t0, start.x)

    # Integrate, noting rows and events
    steps: list[StepBlock] | None = [] if dense_output else None
    stats, rows = _integrate(run, x, options, steps, made if hold is None else None)

    # Put the result together
    held = None if hold is None else hold.held
    if missed := unreached_momenta(stepped, *rows, start=(t0, start.x, x)):
        stats = replace(stats, warnings=(*stats.warnings, *missed))
    early = not stats.success and not stats.message.startswith(INTERRUPTED)
    for text in [*([f"the run {stats.message}"] if early else []), *stats.warnings]:
        warnings.warn(text, SimulationWarning, stacklevel=2)
    dense = None if steps is None else Solution(options.t0, x, steps, problem.nq, stepped.velocities)
    (times, q, qd), momenta = _table(stepped, *rows)
    crossings, graphs = run.crossings(problem.nq), _graphs(problem, applied)
    return Trajectory(times, q, qd, stats, crossings, graphs, dense, held, model.coordinates, model.velocities, momenta)


def _integrate(
    run: Integration,
    x: Array,
    options: RunOptions,
    steps: list[StepBlock] | None,
    again: Callable[[RunOptions], Integration] | None,
) -> tuple[Stats, tuple[Array, Array]]:
    """How a run from x goes, and its rows, times and states.  steps: see `_noted`.  again: see `outcome`."""
    recorder = Recorder(x, options.times, options.t0, options.direction)
    stats = outcome(run, x, recorder, options, _noted(run, x, recorder, options, steps), again)
    if stats.message != REACHED:  # where it ended is its last row, also between the times of t_eval
        recorder.add_last()
    return stats, recorder.table()


def _noted(
    run: Integration, x: Array, recorder: Recorder, options: RunOptions, steps: list[StepBlock] | None
) -> Iterator[StepBlock]:
    """The blocks of a run, until rows and steps fill the memory.  steps: receives them, with their dense output."""
    most, kept = room() / TABLES, 0
    with Progress("simulate", options.length, options.progress) as report:
        for block in run.blocks(x):
            if steps is not None:
                steps.append(block if block.dense is not None else run.with_dense(block))
                kept += steps[-1].nbytes
            yield block if steps is None else steps[-1]
            if recorder.size + kept > most:
                last = f"{recorder.last:.6g} s"
                run.status = f"stopped at t = {last}: the rows fill the memory; t_eval records fewer"
                return
            report(abs(float(block.t[-1]) - options.t0))


def _table(stepped: Problem, times: Array, rows: Array) -> tuple[tuple[Array, Array, Array], Array | None]:
    """t, q and qd of the rows that steps gave; and their momenta, if they are of these."""
    states, nq = converted(stepped.velocities, times, rows), stepped.nq
    return (times, states[:, :nq], states[:, nq:]), rows[:, nq:] if stepped.momenta else None


def _graphs(problem: Problem, applied: Applied) -> dict[str, Graph]:
    """What a trajectory computes accelerations, forces and energies by."""
    forces, whole = force(problem), total_energy(problem)
    graphs = {"rate": problem.rate} | ({} if forces is None else {"force": forces, "tau": applied.graph(problem)})
    graphs |= {} if whole is None else {"energy": whole}
    return graphs | ({} if problem.multipliers is None else {"multipliers": problem.multipliers})
