"""`cgraph bench`: our speed beside that of other software, on the same tasks in turns; and other figures."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict
from typing import Any

from . import library
from .arguments import IN_PYTHON, READING, positive, reading, reads_files, say, whole
from .command import Command

SPEED, MOTIONS = "speed", "motions"
TAKES = {  # options of the two that take scenes
    SPEED: (*READING, "tasks", "modes", "peers", "quick", "budget", "json", "repeats"),
    MOTIONS: ("times", "errors", "peers", "quick", "json", "repeats", "count"),
}
NUMBERS = {"links": "links of the models", "repeats": "turns", "count": "trajectories, or states"}


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = (
        f"figures:\n  {SPEED:16} run times of tasks beside other software (default)\n"
        f"  {MOTIONS:16} what ends of motions cost at equal true error; takes "
        f"{', '.join(f'--{taken}' for taken in TAKES[MOTIONS])}\n{{figures}}"
    )
    parser.names |= {
        "figures": _figures,
        "scenes": lambda: library.speed.SCENES,
        "tasks": lambda: library.speed.TASKS,
        "modes": lambda: library.speed.MODES,
        "peers": lambda: library.speed.PEERS,
        "quick_scenes": lambda: library.speed.QUICK,
        "motions": lambda: library.motions.MOTIONS,
        "motion_peers": lambda: library.motions.PEERS,
    }
    parser.add_argument(
        "what",
        nargs="*",
        metavar="FIGURE | SCENE",
        help=f"a figure of those below, {SPEED} if none; its scenes: {{scenes}} (default: all of these), a name "
        f"that `cgraph scenes` lists, a model file, or {IN_PYTHON}; of {MOTIONS}: {{motions}}",
    )
    reads_files(parser)
    for what in ("tasks", "modes", "peers"):
        more = f"; of {MOTIONS}: {{motion_peers}}" if what == "peers" else ""
        parser.add_argument(f"--{what}", metavar="A,B", help=f"only these of {{{what}}}{more}")
    for what, unit in (("times", "lengths [s]"), ("errors", "true errors")):
        parser.add_argument(f"--{what}", type=positives, metavar="A,B", help=f"of {MOTIONS}: {unit}")
    parser.add_argument("--quick", action="store_true", help="fewer turns and, unless named, {quick_scenes} alone")
    parser.add_argument(
        "--budget", type=positive, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    for name, about in NUMBERS.items():
        parser.add_argument(f"--{name}", type=whole, metavar="N", help=f"{about}, for the figures that take it")
    parser.set_defaults(run=run, words="what")


def _figures() -> list[str]:
    lines = [
        f"  {name:16} {each.about}; takes {', '.join(f'--{taken}' for taken in each.takes)}"
        for name, each in library.FIGURES.items()
    ]
    return ["\n".join(lines)]


def positives(text: str) -> tuple[float, ...]:
    """Positive numbers between commas."""
    return tuple([positive(each) for each in text.split(",")])


def run(options: argparse.Namespace) -> None:
    """Print one figure."""
    figure, scenes = SPEED, options.what
    if scenes and scenes[0] in (*TAKES, *library.FIGURES):
        figure, *scenes = scenes
    takes = TAKES[figure] if figure in TAKES else library.FIGURES[figure].takes
    for name in dict.fromkeys([*TAKES[SPEED], *TAKES[MOTIONS], *NUMBERS]):
        if name not in takes and getattr(options, name) not in (None, False):
            raise ValueError(f"--{name} does not go with {figure}, which takes {', '.join(f'--{x}' for x in takes)}")
    for name in NUMBERS:
        if getattr(options, name) == 0:
            raise ValueError(f"--{name} must be at least 1, got 0")
    if figure in TAKES:
        _print_rows(options, *(_speed if figure == SPEED else _motions)(scenes, options))
        return
    if scenes:
        raise ValueError(f"{figure} has models of its own and takes no scene, got {scenes[0]!r}")
    print(library.machine())
    numbers = {name: getattr(options, name) for name in takes if getattr(options, name) is not None}
    for text in library.FIGURES[figure].run(**numbers):
        print(text, flush=True)


def _chosen(names: str | None, known: Iterable[str]) -> tuple[str, ...]:
    """Names between commas; all where none are given."""
    return tuple(names.split(",")) if names else tuple(known)


def _speed(scenes: list[str], options: argparse.Namespace) -> tuple[Iterator[Any], Callable[..., str]]:
    """Rows of speed, and what makes tables of them."""
    speed = library.speed
    rows = speed.bench(
        scenes or (speed.QUICK if options.quick else tuple(speed.SCENES)),
        _chosen(options.tasks, speed.TASKS),
        _chosen(options.modes, speed.MODES),
        _chosen(options.peers, speed.PEERS),
        repeats=options.repeats or (5 if options.quick else 15),
        budget=(20.0 if options.quick else 60.0) if options.budget is None else options.budget,
        reading=reading(options),
        say=say,
    )
    return rows, library.tables


def _motions(scenes: list[str], options: argparse.Namespace) -> tuple[Iterator[Any], Callable[..., str]]:
    """Rows of motions, and what makes tables of them."""
    motions = library.motions
    rows = motions.motions(
        scenes or (motions.QUICK if options.quick else tuple(motions.MOTIONS)),
        options.times or (motions.TIMES[:2] if options.quick else motions.TIMES),
        options.errors or motions.ERRORS,
        _chosen(options.peers, motions.PEERS),
        turns=options.repeats or (3 if options.quick else motions.TURNS),
        limit=0.3 if options.quick else motions.LIMIT,
        count=options.count or (256 if options.quick else motions.COUNT),
        say=say,
    )
    return rows, motions.tables


def _print_rows(options: argparse.Namespace, measured: Iterator[Any], tables: Callable[..., str]) -> None:
    """Print the tables; of a run that is interrupted, of what has been measured."""
    rows: list[Any] = []
    complete = False
    try:
        rows.extend(measured)
        complete = True
    finally:
        if not complete and rows:
            say("the bench did not come to its end; these rows were measured before")
        if options.json and rows:
            data = {"machine": library.machine(), "complete": complete, "rows": [asdict(row) for row in rows]}
            print(json.dumps(data, indent=1))
        elif rows:
            print(tables(rows, library.machine()))
