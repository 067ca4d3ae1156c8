"""`cgraph bench`: our speed beside that of other software, on the same tasks in turns; and other figures."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from . import library
from .arguments import IN_PYTHON, READING, listed, positive, reading, reads_files, say, whole
from .command import Command

LISTS = ("tasks", "modes", "peers")
NUMBERS = {"links": "links of the models", "repeats": "turns", "count": "trajectories, or states"}
OPTIONS = (*READING, *LISTS, "quick", "budget", "json", "repeats", "times", "errors", "count", "links")


def add(parser: Command) -> None:
    """The command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "figures:\n{figures}"
    parser.names |= {
        "figures": _figures,
        "scenes": lambda: library.speed.SCENES,
        "tasks": lambda: library.speed.TASKS,
        "modes": lambda: library.speed.MODES,
        "peers": lambda: library.speed.PEERS,
        "quick_scenes": lambda: library.speed.QUICK["scenes"],
        "motions": lambda: library.MOTIONS,
        "motion_peers": lambda: library.PEERS,
    }
    parser.add_argument(
        "what",
        nargs="*",
        metavar="FIGURE | SCENE",
        help="a figure of those below, speed if none; its scenes: {scenes} (default: all of these), a name "
        f"that `cgraph scenes` lists, a model file, or {IN_PYTHON}; of motions: {{motions}}",
    )
    reads_files(parser)
    for what in LISTS:
        more = "; of motions: {motion_peers}" if what == "peers" else ""
        parser.add_argument(f"--{what}", type=listed, metavar="A,B", help=f"only these of {{{what}}}{more}")
    for what, unit in (("times", "lengths [s]"), ("errors", "true errors")):
        parser.add_argument(f"--{what}", type=positives, metavar="A,B", help=f"of motions: {unit}")
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
        f"  {name:16} {bench.about}" + f"; takes {_dashed(bench.takes)}" * (name != library.SPEED)
        for name, bench in library.BENCHES.items()
    ]
    return ["\n".join(lines)]


def _dashed(names: tuple[str, ...]) -> str:
    return ", ".join([f"--{name}" for name in names])


def positives(text: str) -> tuple[float, ...]:
    """Positive numbers between commas."""
    return tuple([positive(each) for each in text.split(",")])


def run(options: argparse.Namespace) -> None:
    """Print one figure: tables as they are measured, or at the end; of a run that is interrupted, what it has."""
    name, scenes = library.SPEED, options.what
    if scenes and scenes[0] in library.BENCHES:
        name, *scenes = scenes
    bench, given = library.BENCHES[name], {each: getattr(options, each) for each in OPTIONS}
    for option, value in given.items():
        if option not in bench.takes and value not in (None, False):
            raise ValueError(f"--{option} does not go with {name}, which takes {_dashed(bench.takes)}")
        if option in NUMBERS and value == 0:
            raise ValueError(f"--{option} must be at least 1, got 0")
    if scenes and not bench.rows:
        raise ValueError(f"{name} has models of its own and takes no scene, got {scenes[0]!r}")
    chosen = {each: value for each, value in given.items() if value and each not in (*READING, "quick", "json")}
    if scenes:
        chosen["scenes"] = scenes
    if bench.rows:
        chosen["say"] = say
    if "ignore" in bench.takes:
        chosen["reading"] = reading(options)
    _print(options, bench, chosen)


def _print(options: argparse.Namespace, bench: library.Bench, chosen: dict[str, Any]) -> None:
    found: list[Any] = []
    at_once, complete = not (options.json or bench.rows), False
    try:
        for part in bench.run(options.quick, **chosen):
            if at_once and not found:
                print(library.machine())
            found.append(part)
            if at_once:
                print(part, flush=True)
        complete = True
    finally:
        if found and not complete:
            say("the bench did not come to its end; these rows were measured before")
        if found and options.json:
            rows = [asdict(part) for part in found] if bench.rows else [_plain(part) for part in found if part]
            print(json.dumps({"machine": library.machine(), "complete": complete, "rows": rows}, indent=1))
        elif found and bench.rows:
            print(bench.module.tables(found, library.machine()))


def _plain(part: Any) -> Any:
    """A table as plain data; a line as it is."""
    return part if isinstance(part, str) else part.to_dict()
