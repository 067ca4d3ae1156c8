"""Work and precision: run time beside error of every integrator on one task, ours and others', in one run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from ...integrators import METHODS, Problem
from ...peers.peer import made
from ..accuracy_task import AccuracyTask
from ..text_table import check_names
from ..timing import load as load_of_machine, machine, spent
from .cold_start import STARTS, cold_starts
from .measurement import PEERS, Entry, ErrorMetrics, WorkPrecision, sweep, time_in_turns
from .named_tasks import load
from .trajectory_peers import offers
from .trajectory_runs import EQUAL, Ours, Solver, problem_of

LIMIT = 0.3  # s; no finer knob is tried after a run of this length
PATIENCE = 3.0  # times as long for the others, most of which need more time for the same error


class Subject(NamedTuple):
    """A task made ready: the size of its smallest state, its equations, and what measures errors."""

    task: AccuracyTask
    smallest: float
    problem: Problem
    metrics: ErrorMetrics

    @property
    def title(self) -> str:
        """Title: the motion, and the error of its reference."""
        exact, until = self.metrics.exact, f"{self.task.name}, to t = {self.task.t_end:g} s"
        return f"{until}. Exact motion: {exact.how}; its error {exact.error:.0e}"


def subject(name: str, folder: str | Path | None = None, digits: int | None = None, **options: Any) -> Subject:
    """The task of that name.  folder: where exact motions are kept.  options: as of `named_tasks.load`.

    Raises ValueError where no exact motion is known.
    """
    task = load(name, **options)
    exact = task.solution(task.times, folder, digits)
    if exact is None:
        raise ValueError(f"no solution of {task.name!r} is known to compare with")
    metrics = ErrorMetrics(task, exact)
    return Subject(task, metrics.smallest, problem_of(task), metrics)


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
    before = load_of_machine()
    say(f"{name}: exact motion")
    readied = spent(lambda: subject(name, folder, digits, **(options or {})))
    at, absent = readied.made, dict[str, str]()
    entries: list[Entry[Solver]] = []
    for solver in _solvers(at, methods, peers, backend, absent):
        say(f"{name}: {solver.name}")
        entry = sweep(solver, at.metrics, limit if solver.ours else PATIENCE * limit)
        if entry.tried:
            entries.append(entry)
        else:
            absent[solver.name] = entry.stopped
    say(f"{name}: {turns} turns")
    time_in_turns([tried for entry in entries for tried in entry.tried], turns)
    curves = tuple([entry.curve(at.metrics, at.problem) for entry in entries])
    started = cold_starts(name, options or {}, cold, turns=cold_turns, budget=budget, say=say) if cold else []
    fields = ("name", "about", "t_end", "conservative", "stiff", "left_out")
    return WorkPrecision(
        **{field: getattr(at.task, field) for field in fields},
        states=at.problem.size,
        nodes=len(at.problem.rate.nodes),
        relative_to="own" if at.task.decades else "given" if at.task.size else "largest",
        times=tuple(at.task.times),
        reference=at.metrics.exact.how,
        reference_error=at.metrics.exact.error,
        reference_seconds=readied.seconds,
        machine=machine(),
        load=(before, load_of_machine()),
        curves=curves,
        cold=tuple(started),
        absent=absent,
    )


def _solvers(
    at: Subject, methods: Sequence[str], peers: Sequence[str], backend: str, absent: dict[str, str]
) -> list[Solver]:
    """Solvers that can be made; reasons why others cannot go to `absent`."""
    makers: dict[str, Callable[[], Solver]] = {
        method: partial(Ours, method, *at[:3], backend) for method in METHODS if method in methods
    }
    begins = tuple([PEERS[peer] for peer in peers])
    makers |= {name: make for name, make in offers(*at[:3], backend).items() if name.startswith(begins)}
    solvers = made(makers, absent, ValueError, TypeError)
    if at.task.decades:
        equal = [name for name, solver in solvers.items() if solver.kind == EQUAL]
        absent |= dict.fromkeys(equal, "equal steps cannot span this many powers of ten")
    return [solver for name, solver in solvers.items() if name not in absent]
