"""The bench: tasks of mechanics on a few models by our compiled graph and by its peers, in turns in one run."""

from __future__ import annotations

import statistics
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from cgraph._shared import Array, install
from dynamics.experiments.text_table import WIDTH, check_names, table
from dynamics.multibody.trees.mechanism import as_mechanism
from tests.bench.peers import PEERS, PeerModel
from tests.bench.peers.peer import MODES, MOTIONS, TASKS
from tests.bench.speed.scenes import SCENES, load
from tests.bench.speed.worker import Load, Prepared, Worker
from tests.bench.tables import Footnotes, digits

OURS = "ours"
AGREES = 1e-8  # largest relative difference that passes without a flag: rounding on a long chain, and no more
FEWEST_TURNS, LONG_TURNS = 3, 5.0  # turns of a peer that takes longer than so many seconds for all of its turns
QUICK: dict[str, Any] = {"scenes": ("planar 3", "planar 7", "arm 7"), "repeats": 5, "budget": 20.0}
CONTAINS = {"rk4": "forward", "gradient": "motion"}  # who is late with the second is not asked for the first


@dataclass(frozen=True)
class Cell:
    """One peer on one task of one scene in one mode.

    micros: median time of an evaluation [us].  low, high: quartiles.  made: from the model to the first result [s].
    difference: largest, from ours, over the largest entry of ours; of a step or a loop, that of the motion; None where
    ours was not ready.
    size: nodes or instructions, where they can be counted.
    """

    micros: float
    low: float
    high: float
    made: float
    difference: float | None
    size: int | None


@dataclass(frozen=True)
class Row:
    """One scene, task and mode.  skipped: {peer: reason}, of peers that are installed and have such a function."""

    scene: str
    task: str
    mode: str
    coordinates: int
    cells: dict[str, Cell] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)


def bench(
    scenes: Sequence[str] = tuple(SCENES),
    tasks: Sequence[str] = tuple(TASKS),
    modes: Sequence[str] = tuple(MODES),
    peers: Sequence[str] = tuple(PEERS),
    *,
    repeats: int = 15,
    budget: float = 60.0,
    reading: Mapping[str, Any] | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> Iterator[Row]:
    """Rows, scene by scene, as they are measured. Ours is among the peers in any case.

    scenes: names among `SCENES`, of `dynamics.scenes`, or paths of model files.  repeats: turns of each peer.
    budget: seconds that a peer may take to make one task in one mode.  reading: options of `scenes.of_file`.
    say: takes lines of progress.
    Raises ValueError for an unknown name, a budget that is not positive, and where there is nothing to measure.
    """
    check_names(("task", tasks, TASKS), ("mode", modes, MODES), ("peer", peers, PEERS))
    if not budget > 0.0:
        raise ValueError(f"the budget must be positive, got {budget!r} s")
    loads: dict[str, Load] = {name: partial(load, name, **(reading or {})) for name in scenes}
    cases = {}
    for name, scene in loads.items():  # a wrong name is told before anything is measured
        cases[name] = PeerModel(name, scene())
    wanted = [name for name, kind in PEERS.items() if name == OURS or (name in peers and kind.installed)]
    ours = PEERS[OURS].offers
    asked = {
        task: [mode for mode in MODES if mode in modes and (task, mode) in ours] for task in TASKS if task in tasks
    }
    if all([not wished or _missing(case, task) for case in cases.values() for task, wished in asked.items()]):
        raise ValueError(
            f"there is nothing to measure of {', '.join(asked)} in the modes {', '.join(modes)} on {', '.join(cases)}; "
            f"motions and gradients are called, and not of models with quaternions, or without bodies"
        )

    def rows() -> Iterator[Row]:
        for scene, case in cases.items():
            late: dict[str, dict[str, str]] = {}
            for task, wished in asked.items():
                if missing := _missing(case, task):
                    say(f"{scene}, {task}: {missing}")
                    continue
                late[task] = dict(late.get(CONTAINS.get(task, ""), {}))
                pool = WorkerPool(loads[scene], wanted, budget, late[task])
                try:
                    for mode in wished:
                        say(f"{scene}, {task}, {mode}")
                        yield _row(case, task, mode, pool, repeats)
                finally:
                    pool.end()

    return rows()


def _missing(case: PeerModel, task: str) -> str:
    if task in MOTIONS and case.nq != case.n:
        return "not of quaternions"
    return "not without bodies" if task == "inertial-gradient" and as_mechanism(case.model) is None else ""


def _row(case: PeerModel, task: str, mode: str, pool: WorkerPool, repeats: int) -> Row:
    row = Row(case.name, task, mode, case.n)
    ready = pool.prepared(task, mode, row.skipped)
    samples: dict[str, list[float]] = {peer: [] for peer in ready}
    used = dict.fromkeys(ready, 0.0)
    for turn in range(repeats):  # in turns, so that a busy machine slows all alike
        for peer in [each for each in ready if turn < FEWEST_TURNS or used[each] < LONG_TURNS]:
            begin = time.perf_counter()
            try:
                samples[peer].append(1e6 * pool.workers[peer].turn(task, mode))
            except RuntimeError as error:
                row.skipped[peer] = str(error)
                del ready[peer]
            used[peer] += time.perf_counter() - begin
    start = _start(case, task, mode)
    for peer, prepared in ready.items():
        low, middle, high = np.percentile(samples[peer], (25, 50, 75)).tolist()
        difference = None
        if OURS in ready:
            expected = ready[OURS].values - start
            difference = float(np.abs(prepared.values - start - expected).max() / np.abs(expected).max())
        row.cells[peer] = Cell(middle, low, high, prepared.seconds, difference, prepared.size)
    return row


def _start(case: PeerModel, task: str, mode: str) -> Array:
    """Origin of the values of a step or a loop: they move little, and it is the motion that counts."""
    if mode == "loop":
        return case.point(task)
    if task == "rk4":
        return case.points(task) if mode == "batch" else case.point(task)
    if task == "motion":
        return case.point(task)[: 2 * case.n]
    return np.zeros(1)


class WorkerPool:
    """A worker for each peer on one task of one scene.  late: {peer: why it is not asked any more}."""

    def __init__(self, load: Load, peers: Sequence[str], budget: float, late: dict[str, str]) -> None:
        self.load, self.peers, self.budget, self.late = load, peers, budget, late
        self.workers: dict[str, Worker] = {}

    def prepared(self, task: str, mode: str, skipped: dict[str, str]) -> dict[str, Prepared]:
        """The peers that are ready; why others are not goes to `skipped`."""
        ready = {}
        for peer in self.peers:
            if (task, mode) not in PEERS[peer].offers:
                continue
            if peer in self.late:
                skipped[peer] = self.late[peer]
                continue
            worker = self._worker(peer)
            answer = worker.prepare(task, mode, self.budget)
            if isinstance(answer, Prepared):
                ready[peer] = answer
            else:
                skipped[peer] = answer.reason
                if not worker.alive:
                    self.late[peer] = answer.reason
        return ready

    def _worker(self, peer: str) -> Worker:
        if peer not in self.workers or not self.workers[peer].alive:
            self.workers[peer] = Worker(self.load, peer)
        return self.workers[peer]

    def end(self) -> None:
        """End all processes."""
        for worker in self.workers.values():
            worker.end()


def tables(rows: Sequence[Row], where: str = "") -> str:
    """All tables of these rows, with what the columns and marks mean.  where: the machine, in words."""
    shown = [peer for peer in PEERS if any(peer in row.cells or peer in row.skipped for row in rows)]
    missing = [peer for peer, kind in PEERS.items() if not kind.installed]
    lines = [
        *([*textwrap.wrap(where, WIDTH), ""] if where else []),
        "Medians of alternating turns on one core. In brackets: times ours, above 1 where ours is faster.",
        f"* the fastest of its row.  ! it differs from ours by more than {AGREES:g}.  - a: not measured, see below.",
        "",
        *[f"{peer:<11} {PEERS[peer].about}" for peer in shown],
        *(textwrap.wrap(f"not installed: {', '.join(missing)} ({install('bench')})", WIDTH) if missing else []),
    ]
    for task, about in TASKS.items():
        of_task = [row for row in rows if row.task == task]
        if not of_task:
            continue
        lines += ["", "", f"{about[0].upper()}{about[1:]}"]
        for mode, says in MODES.items():
            if of_mode := [row for row in of_task if row.mode == mode]:
                lines += ["", f"{says[0].upper()}{says[1:]} [us]", *_table(of_mode, _times), *_spread(of_mode)]
        first = [row for row in of_task if row.mode == of_task[0].mode]
        lines += ["", "From the model to the first result [s], and the nodes of our graph", *_table(first, _made, True)]
        lines += ["", "Largest difference from ours, over the largest entry", *_table(_worst(of_task), _differences)]
    return "\n".join(lines)


def _times(row: Row) -> dict[str, tuple[str, str]]:
    ours = row.cells.get(OURS)
    best = min([cell.micros for cell in row.cells.values()], default=0.0)
    result = {}
    for peer, cell in row.cells.items():
        ratio = f"[{digits(cell.micros / ours.micros, 2)}]" if ours and peer != OURS else ""
        marks = ("*" if cell.micros == best else "") + ("" if agrees(cell) else "!")
        result[peer] = digits(cell.micros, 3), ratio + marks
    return result


def _made(row: Row) -> dict[str, tuple[str, str]]:
    return {peer: (digits(cell.made, 2), "") for peer, cell in row.cells.items()}


def _differences(row: Row) -> dict[str, tuple[str, str]]:
    return {
        peer: (f"{cell.difference:.0e}", "" if agrees(cell) else "!")
        for peer, cell in row.cells.items()
        if peer != OURS and cell.difference is not None
    }


def _worst(rows: Sequence[Row]) -> list[Row]:
    """Row of each scene, with the cell of each peer that differs most over the modes."""
    result: dict[str, Row] = {}
    for row in rows:
        kept = result.setdefault(row.scene, Row(row.scene, row.task, row.mode, row.coordinates))
        for peer, cell in row.cells.items():
            worst = kept.cells[peer].difference if peer in kept.cells else None
            if worst is None or not (cell.difference is None or cell.difference <= worst):
                kept.cells[peer] = cell
    return list(result.values())


def agrees(cell: Cell) -> bool:
    """The difference, where one is known, is that of rounding; NaN is not."""
    return cell.difference is None or cell.difference <= AGREES


def _table(rows: Sequence[Row], read: Callable[[Row], dict[str, tuple[str, str]]], nodes: bool = False) -> list[str]:
    """Lines of a table; blocks of columns under each other where they do not fit, then its footnotes."""
    cells = {row.scene: read(row) for row in rows}
    notes = Footnotes()
    shown = [peer for peer in PEERS if any(peer in cells[row.scene] for row in rows)]
    unseen: dict[str, str] = {}  # peer: reason, where it is the same for all
    for row in rows:
        for peer, reason in row.skipped.items():
            if peer in shown:
                cells[row.scene][peer] = "-", notes.mark(reason)
            else:
                unseen[peer] = reason
    head = ["scene", *(["nodes"] if nodes else []), *shown]
    sizes = {row.scene: row.cells[OURS].size if OURS in row.cells else None for row in rows}
    of_ours = {scene: [str(size or "")] if nodes else [] for scene, size in sizes.items()}
    lines = table(
        head, [[scene, *of_ours[scene], *[of.get(peer, "") for peer in shown]] for scene, of in cells.items()]
    )
    return lines + notes.lines() + [f"without {peer}: {reason}" for peer, reason in unseen.items()]


def _spread(rows: Sequence[Row]) -> list[str]:
    spreads = {
        (peer, row.scene): 100.0 * (cell.high - cell.low) / cell.micros
        for row in rows
        for peer, cell in row.cells.items()
    }
    if not spreads:
        return []
    worst = max(spreads, key=lambda each: spreads[each])
    usual, most = digits(statistics.median(spreads.values()), 2), digits(spreads[worst], 2)
    return [f"spread between quartiles: {usual} % of the median as a rule, {most} % at most ({', '.join(worst)})"]
