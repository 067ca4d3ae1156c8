"""Motions: what the end of a motion costs at equal true error, by our methods, prepared, and by other software.

A solver runs once at each tolerance of a ladder; its error is that of the end state, beside an exact one, relative to
the largest values of the states over the longest motion. What a wanted error costs is interpolated between the two
tolerances about it, logarithm by logarithm.
"""

from __future__ import annotations

import math
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cgraph._shared import Array
from dynamics.experiments.accuracy_task import AccuracyTask
from dynamics.experiments.text_table import WIDTH, check_names, table
from dynamics.experiments.work_precision import measurement
from dynamics.experiments.work_precision.measurement import CHOSEN, Entry, ErrorMetrics, ErrorOf, Tried, problem_of
from dynamics.integrators import METHODS, Problem
from dynamics.multiprecision import Reference
from tests.bench.motions.motion_runs import HeyokaBatch, Many, ManyEnds, Motion
from tests.bench.motions.motion_scenes import MOTIONS, TIMES, exact_end, sizes
from tests.bench.motions.trajectory_peers import HEYOKA, OURS, PEERS, EndSolver, Heyoka, group, offers
from tests.bench.peers.peer import made
from tests.bench.tables import Footnotes, digits

DUEL = (OURS, HEYOKA)  # whose ratio is told
GROUPS = (OURS, HEYOKA, *[name for name in PEERS if name != HEYOKA])  # in the order of the columns
ERRORS = (1e-6, 1e-9, 1e-12)
STIFF = ("rodas", "radau")  # methods that only stiff equations are given to
ASKED = {False: ("DOP853", "Adams", "RK4"), True: ("LSODA", "Radau", "BDF")}  # of peers, by stiff
PATIENCE = 3.0  # times as long for the others, most of which need more time for the same error
TURNS, LIMIT = 9, 3.0  # turns of each run; s of a run, after which no finer tolerance is tried
COUNT = 4096  # motions of an ensemble, fewer where one motion is long
LONG_ENSEMBLE = 0.5  # s of all motions of an ensemble together, by the fastest way to compute one
ASIDE = 1e-2  # how far the starts of an ensemble lie apart, in sizes
QUICK: dict[str, Any] = {
    "scenes": ("double pendulum", "kepler 0.9", "van der Pol 100"),
    "times": TIMES[:2],
    "repeats": 3,
    "limit": 0.3,
    "count": 256,
}
LADDER = tuple([10.0**-k for k in range(2, 16)])
TIGHTEST, SMALLEST = 1e-15, 1e-18  # tolerance of the ends of an ensemble; error of none
ENSEMBLE, FEWEST = 10.0, 16  # s: the longest motion of an ensemble; and its fewest motions
COARSER = tuple([10.0**-k for k in range(3, 15, 2)] + [2.0**-52])  # each is compiled anew
STEPS = tuple([2.0**k for k in range(24)])  # of MuJoCo
SLOW = 0.2  # s of the processor: the first run of what takes so long is its time
HOPELESS = 4.0  # times the first run of another of its group: what takes longer is not timed
ROUNDING_ERROR = 1e-13  # an error that is no cause to doubt
TOGETHER = 1.0 / 30.0  # of their errors: ends of two solvers that agree so much better than with the exact one


@dataclass(frozen=True)
class Cell:
    """The cheapest way of a group to a wanted error.

    seconds: by the clock; processor: of the CPU [s]; both of one motion, the shortest of the turns.
    knob: tolerance or number of steps, between the two of the ladder.  steps, evaluations: of the finer of them.
    """

    solver: str
    seconds: float
    processor: float
    knob: float
    steps: int | None
    evaluations: int | None


@dataclass(frozen=True)
class Missed:
    """Reason why a group has no way to an error.  best: the smallest error that it got to, where it ran."""

    why: str
    best: float | None = None


@dataclass(frozen=True)
class Row:
    """One motion, its length and a wanted error.  count: of motions at once.  missed: {group: why it has no cell}.

    doubt: why the exact end may be none; empty as a rule.
    """

    scene: str
    t_end: float
    error: float
    count: int = 1
    cells: dict[str, Cell] = field(default_factory=dict)
    missed: dict[str, Missed] = field(default_factory=dict)
    doubt: str = ""

    @property
    def ratio(self) -> float | None:
        """heyoka's time over ours, of the CPU; None where one of the two is not there."""
        if OURS not in self.cells or HEYOKA not in self.cells:
            return None
        return self.cells[HEYOKA].processor / self.cells[OURS].processor


def motions(
    scenes: Sequence[str] = tuple(MOTIONS),
    times: Sequence[float] = TIMES,
    errors: Sequence[float] = ERRORS,
    peers: Sequence[str] = tuple(PEERS),
    *,
    repeats: int = TURNS,
    limit: float = LIMIT,
    count: int = COUNT,
    exact: Mapping[tuple[str, float], Reference] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Iterator[Row]:
    """Rows, scene by scene, as they are measured: of one motion to each of the times, then of an ensemble.

    scenes: of `MOTIONS`.  times [s], errors: of the rows.  peers: those asked; what is not installed is left out, and
    `say` tells it.  repeats: turns of each run.  limit: seconds of a run, after which no finer tolerance is tried.
    count: motions of the ensemble, at the last time up to 10 s; 0 for none.  exact: ends in place of those known.
    Raises ValueError for an unknown name and for numbers that are not positive.
    """
    check_names(("motion", scenes, MOTIONS), ("peer", peers, PEERS))
    for what, values in (("times", times), ("errors", errors)):
        if not (values and all([value > 0.0 and math.isfinite(value) for value in values])):
            raise ValueError(f"{what} must be positive and finite, got {values!r}")
    wanted = sorted(errors, reverse=True)

    def measured() -> Iterator[Row]:
        for name in scenes:
            size = sizes(name)
            task = replace(MOTIONS[name](), name=name, t_end=max(times), size=tuple(size.tolist()))
            problem = problem_of(task)
            absent: dict[str, Missed] = {}
            solvers = _solvers(task, float(size[size > 0.0].min()), problem, peers, absent)
            once: list[Row] = []
            for t_end in sorted(times):
                end = (exact or {}).get((name, t_end)) or exact_end(name, t_end)
                if isinstance(end, str):
                    yield from [Row(name, t_end, error, missed={OURS: Missed(end)}) for error in wanted]
                    continue
                metrics = ErrorMetrics(replace(task, t_end=t_end), end)
                solvers = [solver.until(t_end) for solver in solvers]
                entries = [_swept(solver, metrics.at_end, limit, say) for solver in solvers]
                doubt = doubted(entries, end.error, metrics.scales[0])
                rows = [Row(name, t_end, error, missed=dict(absent), doubt=doubt) for error in wanted]
                _fill(rows, entries, repeats)
                yield from rows
                if t_end <= ENSEMBLE:
                    once = rows
            if count and once:
                yield from _ensemble(replace(task, t_end=once[0].t_end), solvers, once, count, repeats, say)

    return measured()


def _solvers(
    task: AccuracyTask, smallest: float, problem: Problem, peers: Sequence[str], absent: dict[str, Missed]
) -> list[EndSolver]:
    """Ours, then the peers' that are installed and take this motion; why others do not goes to `absent`."""
    asked = {
        name: make
        for name, make in offers(task, smallest, problem).items()
        if group(name) in peers and (group(name) == HEYOKA or name.endswith(ASKED[task.stiff]))
    }
    refused: dict[str, str] = {}
    theirs = made(asked, refused, ValueError, TypeError)
    absent |= {group(name): Missed(why) for name, why in refused.items()}
    return [*[Motion(name, task, smallest) for name in methods(task.stiff)], *theirs.values()]


def methods(stiff: bool) -> list[str]:
    """Ours that choose their steps; those for stiff equations only where they are."""
    return [name for name, method in METHODS.items() if method.adaptive and (stiff or name not in STIFF)]


def _swept(solver: EndSolver, error_of: ErrorOf, limit: float, say: Callable[[str], None]) -> Entry[EndSolver]:
    """The runs of a solver on its ladder. What a run says of itself is not printed."""
    say(f"{solver.task.name} to {solver.task.t_end:g} s: {solver.name}")
    knobs = STEPS if solver.kind != CHOSEN else COARSER if group(solver.name) == HEYOKA else LADDER
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return measurement.sweep(solver, error_of, limit if solver.ours else PATIENCE * limit, knobs)


def doubted(entries: Sequence[Entry[EndSolver]], error: float, size: Array) -> str:
    """Doubt of the exact end: three solvers, ours and peers, agree far better with each other; or nothing."""
    finest = [(entry.solver, min(entry.tried, key=lambda each: each.error)) for entry in entries if entry.tried]
    for one, ours in finest:
        if not one.ours or ours.error < ROUNDING_ERROR or error > TOGETHER * ours.error:
            continue
        apart = {
            other: float(np.max(np.abs(ours.outcome.x - theirs.outcome.x) / size)) / min(ours.error, theirs.error)
            for other, theirs in finest
        }
        near = [other for other, share in apart.items() if share < TOGETHER]
        if len(near) >= min(3, len(finest)) and not all(other.ours for other in near):
            names = ", ".join([other.name for other in near])
            return f"the exact end is doubted: {names} agree with each other and are {ours.error:.0e} from it"
    return ""


def _fill(rows: Sequence[Row], entries: Sequence[Entry[EndSolver]], turns: int) -> None:
    """Time the runs that decide, and note the cheapest of each group, or why there is none."""
    runs: dict[int, Tried] = {}
    for row in rows:
        asked: dict[str, list[list[Tried]]] = {}
        for entry in entries:
            if about := _about(entry.tried, row.error):
                asked.setdefault(group(entry.solver.name), []).append(about)
        for each in asked.values():
            first = [about[-1].once.processor if about[-1].once else math.inf for about in each]
            chosen = [about for about, once in zip(each, first, strict=True) if once <= HOPELESS * min(first)]
            runs |= {id(one): one for about in chosen for one in about}
    for one in runs.values():
        if one.once and one.once.processor > SLOW and not one.run.seconds:
            one.run.seconds.append(one.once.seconds)
            one.run.processor.append(one.once.processor)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        measurement.time_in_turns([one for one in runs.values() if not one.run.seconds], turns)
    for row in rows:
        for entry in entries:
            name = group(entry.solver.name)
            cell = cost(entry, row.error, row.count)
            if cell is None:
                best, known = min([each.error for each in entry.tried], default=None), row.missed.get(name)
                if known is None or (best is not None and (known.best is None or best < known.best)):
                    row.missed[name] = Missed(entry.stopped, best)
            elif name not in row.cells or cell.processor < row.cells[name].processor:
                row.cells[name] = cell
        for name in row.cells:
            row.missed.pop(name, None)


def _about(tried: Sequence[Tried], error: float) -> list[Tried]:
    """The first run with at most this error, and the one before it; none where no run has."""
    first = next((k for k, each in enumerate(tried) if each.error <= error), None)
    return [] if first is None else list(tried[max(0, first - 1) : first + 1])


def cost(entry: Entry[EndSolver], error: float, count: int) -> Cell | None:
    """Cost of the error, between the two runs about it; of the coarsest run where that is good enough already."""
    about = _about(entry.tried, error)
    if not (about and about[-1].run.seconds and about[0].run.seconds):
        return None
    coarse, fine = about[0], about[-1]
    values = [[each.seconds, min(each.run.processor), each.knob] for each in (coarse, fine)]
    share = 1.0
    if fine.error < error < coarse.error < math.inf:
        share = math.log(coarse.error / error) / math.log(coarse.error / max(fine.error, SMALLEST))
    seconds, processor, knob = [
        math.exp((1.0 - share) * math.log(a) + share * math.log(b)) if min(a, b) > 0.0 else b
        for a, b in zip(*values, strict=True)
    ]
    counts = fine.outcome.steps, fine.outcome.evaluations
    return Cell(entry.solver.name, seconds / count, processor / count, knob, *counts)


def _ensemble(
    task: AccuracyTask,
    solvers: Sequence[EndSolver],
    once: Sequence[Row],
    count: int,
    turns: int,
    say: Callable[[str], None],
) -> Iterator[Row]:
    """Rows of motions from starts whose velocities, or states of first order, lie a hundredth of their sizes apart."""
    single = min([cell.processor for row in once for cell in row.cells.values()], default=math.inf)
    n = min(count, int(LONG_ENSEMBLE / single))
    if n < FEWEST:
        say(f"{task.name}: no ensemble, a motion takes {single:.2g} s")
        return
    size, moved = np.array(task.size), len(task.q) if task.qd else 0
    starts = np.tile(task.start, (n, 1))
    starts[:, moved:] += ASIDE * size[moved:] * np.random.default_rng(0).uniform(-1.0, 1.0, (n, len(size) - moved))
    many: list[EndSolver] = [Many(name, task, starts) for name in methods(task.stiff)]
    many += [HeyokaBatch(task, starts, each) for each in solvers if isinstance(each, Heyoka)][:1]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        tightest = Many("radau" if task.stiff else "taylor", task, starts).ready(TIGHTEST)()
    metrics = ManyEnds(tightest.x, np.where(size > 0.0, size, 1.0))
    entries = [_swept(solver, metrics.at_end, 4.0 * LONG_ENSEMBLE, say) for solver in many]
    rows = [Row(task.name, task.t_end, row.error, n) for row in once]
    _fill(rows, entries, min(turns, 2))
    yield from rows


LEGEND = """\
Milliseconds of the processor for the end of a motion alone at equal true error: beside an exact end, relative to the
largest values of the states. The shortest of turns, between the two tolerances about that error. In brackets: times
ours, above 1 where ours is faster.  clock: the same by the clock.  by: our method.
* the fastest of its row.  < heyoka is faster than ours.  (1e-08) the least error reached.  - a: not measured, below."""


def tables(rows: Sequence[Row], where: str = "") -> str:
    """All tables of these rows, with what the columns and marks mean.  where: the machine, in words."""
    lines = [*([*textwrap.wrap(where, WIDTH), ""] if where else []), LEGEND]
    for many, t_end in dict.fromkeys([(row.count > 1, row.t_end) for row in rows]):
        what = "A motion of N side by side, heyoka's in batch mode" if many else "A motion"
        chosen = [row for row in rows if (row.count > 1, row.t_end) == (many, t_end)]
        lines += ["", "", f"{what}, to t = {t_end:g} s [ms]", *_table(chosen, many)]
    return "\n".join(lines)


def _table(rows: Sequence[Row], many: bool) -> list[str]:
    """Lines of one table, its footnotes, what is doubted, and counts of the rows that are lost."""
    shown = [name for name in GROUPS if any(name in row.cells or name in row.missed for row in rows)]
    notes = Footnotes()
    body = []
    for row in rows:
        texts = [_texts(row, name, notes) for name in shown]
        body.append(
            [row.scene, *[str(row.count)] * many, f"{row.error:.0e}", *[cell for each in texts for cell in each]]
        )
    head = ["motion", *["N"] * many, "error"]
    for name in shown:
        head += [name, *["clock"] * (name in DUEL), *["by"] * (name == OURS)]
    lines = [*table(head, body, left=[k for k, each in enumerate(head) if each in ("motion", "by")]), *notes.lines()]
    lines += [f"! {row.scene}: {row.doubt}" for row in rows if row.doubt and row.error == rows[0].error]
    return lines + [_loss(row) for row in rows if _lost(row)]


def _texts(row: Row, name: str, notes: Footnotes) -> list[str | tuple[str, str]]:
    cell, missed, ours = row.cells.get(name), row.missed.get(name), row.cells.get(OURS)
    more = (name in DUEL) + (name == OURS)
    if cell is None:
        why: tuple[str, str] = ("", "")
        if missed is not None:
            why = ("-", notes.mark(missed.why)) if missed.best is None else (f"({missed.best:.0e})", "")
        return [why, *[""] * more]
    times = f"[{digits(cell.processor / ours.processor, 2)}]" if ours and cell is not ours else ""
    best = cell.processor == min([each.processor for each in row.cells.values()])
    marks = "*" * best + "<" * (name == OURS and _lost(row))
    return [(digits(1e3 * cell.processor, 3), times + marks), *[digits(1e3 * cell.seconds, 3), cell.solver][:more]]


def _lost(row: Row) -> bool:
    return HEYOKA in row.cells and not (row.ratio or 0.0) >= 1.0


def _loss(row: Row) -> str:
    counts = []
    for cell in [row.cells[name] for name in DUEL if name in row.cells]:
        told = {"steps": cell.steps, "evaluations": cell.evaluations}
        counts.append(f"{cell.solver} {', '.join([f'{count} {what}' for what, count in told.items() if count])}")
    return f"< {row.scene}, {row.error:.0e}: {'; '.join(counts)}"
