"""`cgraph bench`: our speed beside that of other software, on the same tasks in turns."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from dynamics.experiments.speed.bench import MODES, PEERS, QUICK, SCENES, TASKS, Row, bench
from dynamics.experiments.speed.bench_table import machine, tables

from .arguments import Commands, may_ignore, positive, say


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser(
        "bench", help="our speed beside what is installed: CasADi, Pinocchio, MuJoCo, heyoka, JAX, SymPy, PyTorch"
    )
    parser.add_argument(
        "scenes",
        nargs="*",
        metavar="SCENE",
        help=f"one of {', '.join(SCENES)} (default: all of these), a name that `cgraph scenes` lists, or a model file",
    )
    may_ignore(parser)
    for what, known in (("tasks", TASKS), ("modes", MODES), ("peers", PEERS)):
        parser.add_argument(f"--{what}", metavar="A,B", help=f"only these of {', '.join(known)}")
    parser.add_argument("--quick", action="store_true", help=f"fewer turns and, unless named, {', '.join(QUICK)} alone")
    parser.add_argument(
        "--budget", type=positive, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    parser.add_argument("--json", action="store_true", help="print as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Print the tables; of a run that is interrupted, of what has been measured."""
    chosen = [
        tuple(given.split(",")) if given else tuple(known)
        for given, known in ((options.tasks, TASKS), (options.modes, MODES), (options.peers, PEERS))
    ]
    rows: list[Row] = []
    measured = bench(
        options.scenes or (QUICK if options.quick else tuple(SCENES)),
        *chosen,
        repeats=5 if options.quick else 15,
        budget=(20.0 if options.quick else 60.0) if options.budget is None else options.budget,
        ignore=options.ignore,
        say=say,
    )
    try:
        rows.extend(measured)
    finally:
        if options.json and rows:
            print(json.dumps({"machine": machine(), "rows": [asdict(row) for row in rows]}, indent=1))
        elif rows:
            print(tables(rows, machine()))
