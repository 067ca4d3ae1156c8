"""`cgraph bench`: our speed beside that of other software, on the same tasks in turns; and other figures."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from . import library
from .arguments import IN_PYTHON, READING, positive, reading, reads_files, say, whole
from .command import Command

SPEED = "speed"
OF_SPEED = (*READING, "tasks", "modes", "peers", "quick", "budget", "json")  # options of speed alone
NUMBERS = {"links": "links of the models", "repeats": "turns", "count": "trajectories, or states"}


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = f"figures:\n  {SPEED:16} run times of tasks beside other software (default)\n{{figures}}"
    parser.names |= {
        "figures": _figures,
        "scenes": lambda: library.speed.SCENES,
        "tasks": lambda: library.speed.TASKS,
        "modes": lambda: library.speed.MODES,
        "peers": lambda: library.speed.PEERS,
        "quick_scenes": lambda: library.speed.QUICK,
    }
    parser.add_argument(
        "what",
        nargs="*",
        metavar="FIGURE | SCENE",
        help=f"a figure of those below, {SPEED} if none; its scenes: {{scenes}} (default: all of these), a name "
        f"that `cgraph scenes` lists, a model file, or {IN_PYTHON}",
    )
    reads_files(parser)
    for what in ("tasks", "modes", "peers"):
        parser.add_argument(f"--{what}", metavar="A,B", help=f"only these of {{{what}}}")
    parser.add_argument("--quick", action="store_true", help="fewer turns and, unless named, {quick_scenes} alone")
    parser.add_argument(
        "--budget", type=positive, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    for name, about in NUMBERS.items():
        parser.add_argument(f"--{name}", type=whole, metavar="N", help=f"of a figure: {about}")
    parser.set_defaults(run=run, words="what")


def _figures() -> list[str]:
    lines = [
        f"  {name:16} {each.about}; takes {', '.join(f'--{taken}' for taken in each.takes)}"
        for name, each in library.FIGURES.items()
    ]
    return ["\n".join(lines)]


def run(options: argparse.Namespace) -> None:
    """Print one figure."""
    figure, scenes = SPEED, options.what
    if scenes and scenes[0] in (SPEED, *library.FIGURES):
        figure, *scenes = scenes
    takes = library.FIGURES[figure].takes if figure in library.FIGURES else (*OF_SPEED, "repeats")
    for name in (*OF_SPEED, *NUMBERS):
        if name not in takes and getattr(options, name) not in (None, False):
            raise ValueError(f"--{name} does not go with {figure}, which takes {', '.join(f'--{x}' for x in takes)}")
    for name in NUMBERS:
        if getattr(options, name) == 0:
            raise ValueError(f"--{name} must be at least 1, got 0")
    if figure == SPEED:
        _speed(scenes, options)
        return
    if scenes:
        raise ValueError(f"{figure} has models of its own and takes no scene, got {scenes[0]!r}")
    print(library.machine())
    numbers = {name: getattr(options, name) for name in takes if getattr(options, name) is not None}
    for text in library.FIGURES[figure].run(**numbers):
        print(text, flush=True)


def _speed(scenes: list[str], options: argparse.Namespace) -> None:
    """Print the tables; of a run that is interrupted, of what has been measured."""
    chosen = [
        tuple(names.split(",")) if names else tuple(known)
        for names, known in (
            (options.tasks, library.speed.TASKS),
            (options.modes, library.speed.MODES),
            (options.peers, library.speed.PEERS),
        )
    ]
    rows: list[library.speed.Row] = []
    complete = False
    measured = library.speed.bench(
        scenes or (library.speed.QUICK if options.quick else tuple(library.speed.SCENES)),
        *chosen,
        repeats=options.repeats or (5 if options.quick else 15),
        budget=(20.0 if options.quick else 60.0) if options.budget is None else options.budget,
        reading=reading(options),
        say=say,
    )
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
            print(library.tables(rows, library.machine()))
