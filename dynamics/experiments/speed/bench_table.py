"""Tables of the bench, as text for a terminal: a table for each task and mode, scenes down, contenders across."""

from __future__ import annotations

import statistics
import string
import textwrap
from collections.abc import Callable, Sequence

from cgraph.extend import install

from ...peers import PEERS
from ..text_table import WIDTH, digits, table
from .bench import AGREES, MODES, OURS, TASKS, Cell, Row

HOW = f"{install('bench')}; PyTorch by itself"  # to install what is missing


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
        *(textwrap.wrap(f"not installed: {', '.join(missing)} ({HOW})", WIDTH) if missing else []),
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
    """Time, and ratio with marks, of each peer."""
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
    """One row for each scene, of each peer the cell that differs most over the modes."""
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
    notes: dict[str, str] = {}  # reason: letter
    shown = [peer for peer in PEERS if any(peer in cells[row.scene] for row in rows)]
    unseen: dict[str, str] = {}  # peer: reason, where it is the same for all
    for row in rows:
        for peer, reason in row.skipped.items():
            if peer in shown:
                letter = notes.setdefault(reason, string.ascii_lowercase[min(len(notes), 25)])
                cells[row.scene][peer] = "-", letter
            else:
                unseen[peer] = reason
    head = ["scene", *(["nodes"] if nodes else []), *shown]
    sizes = {row.scene: row.cells[OURS].size if OURS in row.cells else None for row in rows}
    of_ours = {scene: [str(size or "")] if nodes else [] for scene, size in sizes.items()}
    lines = table(
        head, [[scene, *of_ours[scene], *[of.get(peer, "") for peer in shown]] for scene, of in cells.items()]
    )
    lines += [f"{letter}: {reason}" for reason, letter in notes.items()]
    return lines + [f"without {peer}: {reason}" for peer, reason in unseen.items()]


def _spread(rows: Sequence[Row]) -> list[str]:
    """How much the turns of a contender differed."""
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
