"""Work and precision: run time beside error of every integrator on one task, ours and others', in one run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from ...integrators import METHODS, Problem
from ...multiprecision import Reference
from ...peers import UnavailableError
from ..accuracy_task import AccuracyTask
from ..machine import load as load_of_machine, machine
from .cold_start import STARTS, cold_starts
from .measurement import PEERS, Entry, ErrorMetrics, WorkPrecision, in_turns, sweep
from .named_tasks import load
from .trajectory_peers import offers
from .trajectory_runs import EQUAL, Ours, Solver, problem_of

LIMIT = 0.3  # s; no finer knob is tried after a run of this length
PATIENCE = 3.0  # times as long for the others, most of which need more time for the same error


def work_precision(
    name: str,
    *,
    methods: Sequence[str] = tuple(METHODS),
    peers: Sequence[str] = tuple(PEERS),
    digits: int | None = None,
    turns: int = 9,
    limit: float = LIMIT,
    cold: Sequence[str] = tuple(STARTS),
    cold_turns: int = 5,
    budget: float = 60.0,
    folder: str | Path | None = None,
    backend: str = "auto",
    options: dict[str, Any] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> WorkPrecision:
    """The report of a task.

    name, options: as of `named_tasks.load`.  methods: ours.  peers: of `PEERS`; what is not installed is absent.
    digits: of the exact motion (default: the task's).  turns: all solvers run in turns, this often.  limit: seconds
    of a run after which no finer knob is tried, thrice as long for the others.  cold: of `cold_start.STARTS`, with
    `cold_turns` turns and `budget` seconds each.  folder: where exact motions are kept.  backend: see `simulate`.
    say: takes progress lines.

    Raises ValueError for a name that is not known, ImportError without what makes the exact motion, and what
    `reference` raises.
    """
    check_names(("method", methods, METHODS), ("peer", peers, PEERS), ("cold start", cold, STARTS))
    if turns < 1 or not limit > 0.0:
        raise ValueError(f"turns must be at least 1 and limit positive, got {turns!r} and {limit!r} s")
    task = load(name, **(options or {}))
    begin, before = time.perf_counter(), load_of_machine()
    say(f"{name}: exact motion")
    metrics = error_metrics(task, digits, folder)
    spent = time.perf_counter() - begin
    problem = problem_of(task)
    absent: dict[str, str] = {}
    entries: list[Entry[Solver]] = []
    for solver in _solvers(task, metrics.smallest, problem, methods, peers, backend, absent):
        say(f"{name}: {solver.name}")
        entry = sweep(solver, metrics, limit if solver.ours else PATIENCE * limit)
        if entry.tried:
            entries.append(entry)
        else:
            absent[solver.name] = entry.stopped
    say(f"{name}: {turns} turns")
    in_turns([tried for entry in entries for tried in entry.tried], turns)
    curves = tuple([entry.curve(metrics, problem) for entry in entries])
    started = cold_starts(name, options or {}, cold, turns=cold_turns, budget=budget, say=say) if cold else []
    load_now, described = load_of_machine(), _described(task, problem, metrics.exact)
    measured: dict[str, Any] = {"curves": curves, "cold": tuple(started), "absent": absent, "reference_seconds": spent}
    return WorkPrecision(**described, **measured, machine=machine(), load=(before, load_now))


def _described(task: AccuracyTask, problem: Problem, exact: Reference) -> dict[str, Any]:
    """Facts of the report on the task and its exact motion."""
    fields = ("name", "about", "t_end", "conservative", "stiff", "left_out")
    return {name: getattr(task, name) for name in fields} | {
        "states": problem.size,
        "nodes": len(problem.rate.nodes),
        "relative_to": "own" if task.decades else "given" if task.size else "largest",
        "times": tuple(task.times),
        "reference": exact.how,
        "reference_error": exact.error,
    }


def check_names(*choices: tuple[str, Iterable[str], Iterable[str]]) -> None:
    """Raise ValueError for a name that is not known; choices: of (what they name, names, those known)."""
    for what, names, known in choices:
        if unknown := [name for name in names if name not in known]:
            raise ValueError(f"there is no {what} {unknown[0]!r}; there are {', '.join(known)}")


def error_metrics(task: AccuracyTask, digits: int | None = None, folder: str | Path | None = None) -> ErrorMetrics:
    """The task's exact motion, and errors against it. Raises ValueError where no such motion is known."""
    exact = task.solution(task.times, folder, digits)
    if exact is None:
        raise ValueError(f"no solution of {task.name!r} is known to compare with")
    return ErrorMetrics(task, exact)


def _solvers(
    task: AccuracyTask,
    smallest: float,
    problem: Problem,
    methods: Sequence[str],
    peers: Sequence[str],
    backend: str,
    absent: dict[str, str],
) -> Iterable[Solver]:
    """Solvers that can be made; reasons why others cannot go to `absent`."""
    makers: dict[str, Callable[[], Solver]] = {
        method: lambda method=method: Ours(method, task, smallest, problem, backend)  # type: ignore[misc]
        for method in METHODS
        if method in methods
    }
    begins = tuple([PEERS[peer] for peer in peers])
    makers |= {name: make for name, make in offers(task, smallest, problem, backend).items() if name.startswith(begins)}
    for name, make in makers.items():
        try:
            solver = make()
            if solver.kind == EQUAL and task.decades:
                absent[name] = "equal steps cannot span this many powers of ten"
                continue
            yield solver
        except ImportError as error:
            absent[name] = f"not installed ({error})"
        except (UnavailableError, ValueError, TypeError) as error:
            absent[name] = " ".join(str(error).split())[:200]
