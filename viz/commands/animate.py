"""`cgraph animate`: a film of a scene's motion, or of two, one driven by the right torque and one by the flawed."""

import argparse
from collections.abc import Callable

import dynamics as dyn
from cgraph import _shared

from . import library
from .arguments import FORMULATIONS, answer, formulation, place, positive, started, takes_a_scene, takes_a_start
from .command import Command, flag, say

DRIVEN = ("by_definition", "chain_rule")
WORDS = {"by_definition": "by definition", "chain_rule": "by the chain rule"}  # others by their names


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    takes_a_start(parser)
    parser.add_argument("--out", type=place, required=True, help="file to write, a .gif")
    flag(parser, "--driven", "two side by side: the same motion is wanted, driven by two torques")
    parser.add_argument(
        "--formulations",
        nargs=2,
        type=formulation,
        choices=FORMULATIONS,
        metavar=("LEFT", "RIGHT"),
        help=f"with --driven: whose torques (default: {' '.join(DRIVEN)})",
    )
    parser.add_argument("--t-end", type=positive, metavar="S", help="how long, in place of the scene's time")
    parser.add_argument(
        "--speed", type=positive, default=1.0, metavar="X", help="seconds of the motion in one of the film"
    )
    flag(parser, "--dark", "on a dark page")


def run(options: argparse.Namespace) -> int:
    """Write the film; 1 where a motion ends before its time."""
    library.require_film(options.out)
    if options.formulations and not options.driven:
        raise ValueError("--formulations goes with --driven")
    _shared.check_writable(options.out)
    library.check_can_plot()
    scene, _ = started(options, free=not options.driven)
    end = scene.t_end if options.t_end is None else options.t_end
    library.frames(end, options.speed)  # before the work
    say(f"{scene.name}: a motion of {end:g} s")
    motions: dict[str, dyn.Trajectory] = {}
    marked: list[str] = []
    wanted: Callable[[_shared.Array], _shared.Array] | None = None
    if options.driven:
        for name in options.formulations or DRIVEN:
            words = f"torque {WORDS.get(name, name.replace('_', ' '))}"
            motions[words], wanted = library.driven(scene, name, end)
            if dyn.formulation_verdict(scene, name).differs:
                marked.append(words)
    else:
        motions[scene.name] = dyn.simulate(scene, scene.q, None if scene.ode else scene.qd, end)
    say(f"{scene.name}: drawing {library.frames(max(each.t[-1] for each in motions.values()), options.speed)} frames")
    title = f"{scene.name}: the gray motion is wanted" if options.driven else ""
    film = library.animate(
        scene, motions, wanted=wanted, marked=marked, speed=options.speed, dark=options.dark, title=title
    )
    answer(f"{options.out}: {len(film) / 1e3:.0f} kB", {options.out: film})
    return 0 if all([each.stats.success for each in motions.values()]) else 1
