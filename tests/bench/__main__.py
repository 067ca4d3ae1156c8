"""`python -m tests.bench`: our speed beside that of other software, on the same tasks in turns; and other figures."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from dynamics.experiments.timing import machine
from dynamics.integrators import METHODS
from viz.commands.arguments import IN_PYTHON, READING, positive, reading, reads_files, whole
from viz.commands.report import listed

from .benches import BENCHES, SPEED, Bench
from .motions.motion_scenes import MOTIONS
from .motions.trajectory_peers import PEERS as MOTION_PEERS
from .speed import bench as speed
from .tables import Wrong

LISTS = {"tasks": speed.TASKS, "modes": speed.MODES, "peers": speed.PEERS, "methods": METHODS}
NUMBERS = {"links": "links of the models", "repeats": "turns", "count": "trajectories, states or cases"}
OPTIONS = (*READING, *LISTS, *NUMBERS, "quick", "budget", "times", "errors", "seed", "cases")


def parser() -> argparse.ArgumentParser:
    """The arguments."""
    figures = [
        f"  {name:16} {bench.about}" + f"; takes {dashed(bench.takes)}" * (name != SPEED and bool(bench.takes))
        for name, bench in BENCHES.items()
    ]
    result = argparse.ArgumentParser(
        prog="python -m tests.bench",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="\n".join(["figures:", *figures]),
    )
    result.add_argument(
        "what",
        nargs="*",
        metavar="FIGURE | SCENE",
        help=f"a figure of those below, speed if none; its scenes: {', '.join(speed.SCENES)} (default: all of these), "
        f"a name that `cgraph scenes` lists, a model file, or {IN_PYTHON}; of motions: {', '.join(MOTIONS)}",
    )
    reads_files(result)
    for what, names in LISTS.items():
        more = f"; of motions: {', '.join(MOTION_PEERS)}" if what == "peers" else ""
        result.add_argument(f"--{what}", type=listed, metavar="A,B", help=f"only these of {', '.join(names)}{more}")
    for what, unit in (("times", "lengths [s]"), ("errors", "true errors")):
        result.add_argument(f"--{what}", type=positives, metavar="A,B", help=f"of motions: {unit}")
    quick = ", ".join(speed.QUICK["scenes"])
    result.add_argument("--quick", action="store_true", help=f"fewer turns and, unless named, {quick} alone")
    result.add_argument(
        "--budget", type=positive, metavar="S", help="seconds a peer may take to make one task (default: 60; quick: 20)"
    )
    result.add_argument("--seed", type=whole, metavar="N", help="of hybrid: of the first case")
    result.add_argument("--cases", action="store_true", help="of hybrid: members of faults that were found, by name")
    result.add_argument("--json", action="store_true", help="print as JSON")
    for name, about in NUMBERS.items():
        result.add_argument(f"--{name}", type=whole, metavar="N", help=f"{about}, for the figures that take it")
    return result


def dashed(names: Sequence[str]) -> str:
    """Options as they are typed."""
    return ", ".join([f"--{name}" for name in names])


def positives(text: str) -> tuple[float, ...]:
    """Positive numbers between commas."""
    return tuple([positive(each) for each in text.split(",")])


def say(line: str) -> None:
    """Print a line of progress."""
    print(f"bench: {line}", file=sys.stderr, flush=True)


def run(options: argparse.Namespace) -> int:
    """Print one figure: tables as they are measured, or at the end; of a run that is interrupted, what it has.

    1 where something is wrong.
    """
    name, scenes = SPEED, options.what
    if scenes and scenes[0] in BENCHES:
        name, *scenes = scenes
    bench, given = BENCHES[name], {each: getattr(options, each) for each in OPTIONS}
    for option, value in given.items():
        if option not in bench.takes and value not in (None, False):
            raise ValueError(f"--{option} does not go with {name}, which takes {dashed(bench.takes) or 'none'}")
        if option in NUMBERS and value == 0:
            raise ValueError(f"--{option} must be at least 1, got 0")
    if scenes and not bench.rows:
        raise ValueError(f"{name} has models of its own and takes no scene, got {scenes[0]!r}")
    chosen = {each: value for each, value in given.items() if value and each not in (*READING, "quick")}
    if scenes:
        chosen["scenes"] = scenes
    if bench.rows:
        chosen["say"] = say
    if "ignore" in bench.takes:
        chosen["reading"] = reading(options)
    return int(any([isinstance(part, Wrong) for part in show(options, bench, chosen)]))


def show(options: argparse.Namespace, bench: Bench, chosen: dict[str, Any]) -> list[Any]:
    """What a bench has measured, printed."""
    found: list[Any] = []
    at_once, complete = not (options.json or bench.rows), False
    try:
        for part in bench.run(options.quick, **chosen):
            if at_once and not found:
                print(machine())
            found.append(part)
            if at_once:
                print(part, flush=True)
        complete = True
    finally:
        if found and not complete:
            say("the bench did not come to its end; these rows were measured before")
        if found and options.json:
            plain = (
                [asdict(part) for part in found]
                if bench.rows
                else [part if isinstance(part, str) else part.to_dict() for part in found if part]
            )
            print(json.dumps({"machine": machine(), "complete": complete, "rows": plain}, indent=1))
        elif found and bench.rows:
            print(bench.module.tables(found, machine()))
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one figure; 0 where it was measured, 1 where that is wrong, 2 for a wrong choice, 130 for Ctrl-C."""
    options = parser().parse_intermixed_args(arguments)
    try:
        return run(options)
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, ImportError, RuntimeError, ArithmeticError) as error:
        say(f"error: {' '.join(str(error).split())}")
        return 2


if __name__ == "__main__":
    sys.exit(main())
