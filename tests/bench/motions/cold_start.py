"""Cold starts: from a model to the end of its first run, each in a process of its own that finds nothing compiled."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.timing import spent
from dynamics.experiments.work_precision.named_tasks import load
from dynamics.experiments.work_precision.trajectory_runs import problem_of
from dynamics.simulation.simulate import simulate
from tests.bench.motions.trajectory_peers import (
    MOST_STEPS,
    Scipy,
    casadi_equations,
    heyoka_derivatives,
    heyoka_equations,
)
from tests.bench.peers import PeerModel, UnavailableError
from tests.bench.peers.casadi import CasadiPeer, casadi
from tests.bench.peers.heyoka import heyoka, leave_cache
from tests.bench.timing import run_fresh

RTOL = 1e-9  # of all but heyoka, whose default is the resolution of float64
LONG_START = 5.0  # s; what takes longer is started once


@dataclass(frozen=True)
class ColdStart:
    """seconds: the shortest of the turns; median of them.  loading: of the packages [s], beforehand.

    status: empty, or why there is no figure.
    """

    name: str
    about: str
    seconds: float
    median: float
    loading: float
    turns: int
    status: str = ""


@dataclass(frozen=True)
class _Start:
    about: str
    packages: tuple[str, ...]
    run: Callable[[AccuracyTask], object]
    primed: bool = False  # the first start is there to fill a cache, and does not count


def _ours(task: AccuracyTask) -> None:
    method = "radau" if task.stiff else "dop853"
    start = task.q, task.qd or None
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
    "ours": _Start("our graph, LLVM, and a run of dop853 (radau where it is stiff)", ("llvmlite.binding",), _ours),
    "scipy": _Start(
        "our graph, LLVM, and SciPy's DOP853 (Radau where it is stiff) on it",
        ("llvmlite.binding", "scipy.integrate"),
        _scipy,
    ),
    "CasADi": _Start("CasADi's own derivatives in its virtual machine, and a run of CVODES", ("casadi",), _casadi),
    "heyoka compact": _Start(
        "heyoka's own derivatives, its Taylor integrator in compact mode at its default tolerance, and a run",
        ("heyoka",),
        partial(_heyoka, compact=True),
    ),
    "heyoka": _Start("the same, with its code written out", ("heyoka",), _heyoka),
    "heyoka cached": _Start(
        "the same, when an earlier process has left the machine code in heyoka's cache on disk",
        ("heyoka",),
        partial(_heyoka, cached=True),
        primed=True,
    ),
}


def cold_starts(
    name: str,
    options: dict[str, Any],
    wanted: Sequence[str] = tuple(STARTS),
    *,
    turns: int = 5,
    budget: float = 60.0,
    say: Callable[[str], None] = lambda line: None,
) -> list[ColdStart]:
    """Cold starts of a task, in turns.  name, options: as of `named_tasks.load`.

    budget: seconds after which one is given up.  What needs a package that is not installed is left out.
    """
    asked = [each for each in wanted if all(find_spec(package.partition(".")[0]) for package in STARTS[each].packages)]
    times: dict[str, list[float]] = {each: [] for each in asked}
    loading, status = dict.fromkeys(asked, 0.0), dict.fromkeys(asked, "")
    for turn in range(turns):
        for each in asked:
            if status[each] or (turn and min(times[each]) > LONG_START):
                continue
            if not turn:
                say(f"{name}: cold start, {each}")
            try:
                for _ in range(1 + (STARTS[each].primed and not turn)):
                    answer = run_fresh(__name__, "child", each, name, options, timeout=budget)
                times[each].append(answer["seconds"])
                loading[each] = answer["loading"]
            except RuntimeError as error:
                status[each] = str(error)
    return [
        ColdStart(
            name,
            STARTS[name].about,
            min(seconds, default=math.nan),
            statistics.median(seconds or [math.nan]),
            loading[name],
            len(seconds),
            status[name],
        )
        for name, seconds in times.items()
    ]


def child(which: str, name: str, options: dict[str, Any]) -> dict[str, float]:
    """The process's side: how long the start took, and its packages to load."""
    start = STARTS[which]
    loading = spent(lambda: [import_module(package) for package in start.packages]).seconds
    task = load(name, **options)
    return {"seconds": spent(lambda: start.run(task)).seconds, "loading": loading}
