"""`cgraph bench`: our speed beside that of other software, on the same tasks in turns; and other figures."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dynamics.experiments.machine import machine
from dynamics.experiments.speed.bench import MODES, PEERS, QUICK, SCENES, TASKS, Row, bench
from dynamics.experiments.speed.bench_figures import FIGURES
from dynamics.experiments.speed.bench_table import tables

from .arguments import IN_PYTHON, READING, Commands, positive, reading, reads_files, say, whole

SPEED = "speed"
OF_SPEED = (*READING, "tasks", "modes", "peers", "quick", "budget", "json")  # options of speed alone
NUMBERS = {"links": "links of the models", "repeats": "turns", "count": "trajectories, or states"}


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "bench",
        help="our speed beside what is installed: CasADi, Pinocchio, MuJoCo, heyoka, JAX, SymPy, PyTorch",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="\n".join(
            [
                "figures:",
                f"  {SPEED:16} run times of tasks beside other software (default)",
                *[
                    f"  {name:16} {each.about}; takes {', '.join(f'--{taken}' for taken in each.takes)}"
                    for name, each in FIGURES.items()
                ],
            ]
        ),
    )
    parser.add_argument(
        "what",
        nargs="*",
        metavar="FIGURE | SCENE",
        help=f"a figure of those below, {SPEED} if none; its scenes: {', '.join(SCENES)} (default: all of these), a "
        f"name that `cgraph scenes` lists, a model file, or {IN_PYTHON}",
    )
    reads_files(parser)
    for what, known in (("tasks", TASKS), ("modes", MODES), ("peers", PEERS)):
        parser.add_argument(f"--{what}", metavar="A,B", help=f"only these of {', '.join(known)}")
    parser.add_argument("--quick", action="store_true", help=f"fewer turns and, unless named, {', '.join(QUICK)} alone")
    parser.add_argument(
        "--budget", type=positive, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    for name, about in NUMBERS.items():
        parser.add_argument(f"--{name}", type=whole, metavar="N", help=f"of a figure: {about}")
    parser.set_defaults(run=run, words="what")


def run(options: argparse.Namespace) -> None:
    """Print one figure."""
    figure, scenes = SPEED, options.what
    if scenes and scenes[0] in (SPEED, *FIGURES):
        figure, *scenes = scenes
    takes = FIGURES[figure].takes if figure in FIGURES else (*OF_SPEED, "repeats")
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
    print(machine())
    numbers = {name: getattr(options, name) for name in FIGURES[figure].takes if getattr(options, name) is not None}
    for text in FIGURES[figure].run(**numbers):
        print(text, flush=True)


def _speed(scenes: list[str], options: argparse.Namespace) -> None:
    """Print the tables; of a run that is interrupted, of what has been measured."""
    chosen = [
        tuple(names.split(",")) if names else tuple(known)
        for names, known in ((options.tasks, TASKS), (options.modes, MODES), (options.peers, PEERS))
    ]
    rows: list[Row] = []
    complete = False
    measured = bench(
        scenes or (QUICK if options.quick else tuple(SCENES)),
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
            data = {"machine": machine(), "complete": complete, "rows": [asdict(row) for row in rows]}
            print(json.dumps(data, indent=1))
        elif rows:
            print(tables(rows, machine()))
