"""Cold starts: from a model to the end of its first run, each in a process of its own that finds nothing compiled."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import NamedTuple

from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.timing import spent
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.experiments.work_precision.trajectory_runs import problem_of
from dynamics.simulation.simulate import simulate
from dynamics.verification.residual import UnavailableError
from tests.bench.motions.trajectory_peers import (
    MOST_STEPS,
    Scipy,
    casadi_equations,
    heyoka_derivatives,
    heyoka_equations,
)
from tests.bench.peers import PeerModel
from tests.bench.peers.casadi import CasadiPeer, casadi
from tests.bench.peers.heyoka import heyoka, leave_cache
from tests.bench.tables import Table
from tests.bench.timing import run_fresh

RTOL = 1e-9  # of all but heyoka, whose default is the resolution of float64
LONG_START = 5.0  # s; what takes longer is started once


class Start(NamedTuple):
    """A way to start.  packages: loaded beforehand.  primed: the first start fills a cache, and does not count."""

    packages: tuple[str, ...]
    run: Callable[[AccuracyTask], object]
    primed: bool = False


def _ours(task: AccuracyTask) -> None:
    start = task.q, task.qd or None
    method = "radau" if task.stiff else "dop853"
    run = simulate(task.model, *start, task.t_end, method, rtol=RTOL, atol=RTOL, progress=False)
    if not run.stats.success:
        raise RuntimeError(run.stats.message)


def _scipy(task: AccuracyTask) -> None:
    found = Scipy("Radau" if task.stiff else "DOP853", task, 1.0, problem_of(task)).ready(RTOL)()
    if found.status:
        raise RuntimeError(found.status)


def _heyoka(task: AccuracyTask, compact: bool = False, cached: bool = False) -> None:
    """Rate from the Lagrangian by heyoka's own derivatives; a state equation, or what it cannot derive, from ours."""
    hy = heyoka()
    if not cached:
        leave_cache(hy)
    try:
        system = heyoka_derivatives(hy, task)
    except UnavailableError:
        system = heyoka_equations(hy, problem_of(task))
    run = hy.taylor_adaptive(system, list(task.start), compact_mode=compact)
    outcome, _, _, steps, *_ = run.propagate_until(task.t_end, max_steps=MOST_STEPS)
    if outcome != hy.taylor_outcome.time_limit:
        raise RuntimeError(f"stopped after {steps} steps")


def _casadi(task: AccuracyTask) -> None:
    """Rate from the Lagrangian by CasADi's own derivatives; a state equation as it is."""
    ca = casadi()
    if task.mechanical:
        case = PeerModel(task.name, task.model)
        q, qd = ca.SX.sym("q", case.n), ca.SX.sym("qd", case.n)
        qdd = CasadiPeer(case).function("forward")(ca.vertcat(q, qd, ca.SX.zeros(case.n)))
        equations = {"x": ca.vertcat(q, qd), "ode": ca.vertcat(qd, qdd)}
    else:
        equations = casadi_equations(ca, problem_of(task))
    options = {"reltol": RTOL, "abstol": RTOL, "max_num_steps": 1_000_000}
    ca.integrator("run", "cvodes", equations, 0.0, task.t_end, options)(x0=list(task.start))


STARTS = {
    "ours": Start(("llvmlite.binding",), _ours),
    "scipy": Start(("llvmlite.binding", "scipy.integrate"), _scipy),
    "CasADi": Start(("casadi",), _casadi),
    "heyoka compact": Start(("heyoka",), partial(_heyoka, compact=True)),
    "heyoka": Start(("heyoka",), _heyoka),
    "heyoka cached": Start(("heyoka",), partial(_heyoka, cached=True), primed=True),
}


def cold_starts(name: str, t_end: float, turns: int = 5, budget: float = 120.0) -> Table:
    """Cold starts of a task, in turns, as a table.  name: of `named_tasks.load`.

    budget: seconds after which one is given up.  What needs a package that is not installed is left out.
    """
    asked = {
        who: start
        for who, start in STARTS.items()
        if all(find_spec(package.partition(".")[0]) for package in start.packages)
    }
    times: dict[str, list[float]] = {who: [] for who in asked}
    status = dict.fromkeys(asked, "")
    for turn in range(turns):
        for who, start in asked.items():
            if status[who] or (turn and min(times[who]) > LONG_START):
                continue
            try:
                for _ in range(1 + (start.primed and not turn)):
                    seconds = run_fresh(__name__, "child", who, name, t_end, timeout=budget)
                times[who].append(seconds)
            except RuntimeError as error:
                status[who] = str(error)
    rows = []
    for who, taken in times.items():
        figures = (min(taken), statistics.median(taken), min(taken) / min(times["ours"])) if taken else ()
        rows.append([who, *([f"{figure:.3f}" for figure in figures] or ["-"] * 3), status[who]])
    title = "cold start: model to end of first run, nothing compiled; heyoka at its default tolerance [s]"
    return Table(title, ["", "shortest", "median", "times ours", "status"], rows, left=(0, 4))


def child(which: str, name: str, t_end: float) -> float:
    """The process's side: how long the start took, its packages loaded before."""
    start = STARTS[which]
    for package in start.packages:
        import_module(package)
    task = load(name, t_end=t_end)
    return spent(lambda: start.run(task)).seconds
