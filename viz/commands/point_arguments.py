"""Points and boxes of a graph's inputs and starts, from the command line: `q.knee=0.1,qd0=2` and `q0=-1:1`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import cgraph as cg
import dynamics as dyn
from cgraph import extend

from . import library
from .arguments import number, say, scene_of

SEED, DIGITS = 20250814, 3  # of the numbers that nobody gave: always the same, and short enough to be typed again

DT = 1e-3  # s, the step of an embedded relation
SHOWN = 12  # inputs that a line of text names

REST = (
    f"of the inputs that it leaves out, parameters keep their values, dt is {DT} s, t is 0, "
    "and the rest have numbers between -1 and 1, always the same"
)


def point(text: str) -> dict[str, float]:
    """`q0=0.1,qd0=2` as numbers by name, for argparse."""
    return {name: _number(name, value) for name, value in _pairs(text)}


def box(text: str) -> dict[str, tuple[float, float]]:
    """`q0=-1:1,qd0=0:2` as intervals by name, for argparse."""
    intervals = {}
    for name, value in _pairs(text):
        low, colon, high = value.partition(":")
        if not colon:
            raise argparse.ArgumentTypeError(f"{name} needs an interval such as -1:1, got {value!r}")
        intervals[name] = _number(name, low), _number(name, high)
        if intervals[name][0] > intervals[name][1]:
            raise argparse.ArgumentTypeError(f"{name} needs its lower end first, got {value!r}")
    return intervals


def filled(graph: cg.Graph, scene: dyn.scenes.Scene, given: dict[str, float]) -> dict[str, float]:
    """The given numbers with the rest that the graph's inputs need, by the graph's names. Raises for unknown names."""
    import numpy as np

    chosen = np.random.default_rng(SEED)
    parameters = scene.parameters
    values = {}
    for name in graph.input_names:
        drawn = round(chosen.uniform(-1.0, 1.0), DIGITS)
        values[name] = parameters[name] if name in parameters else {"dt": DT, "t": 0.0}.get(name, drawn)
    return values | extend.Names(graph, dyn.display_names(scene)).inputs_of("--at", given)


def takes_a_start(command: argparse.ArgumentParser) -> None:
    """The argument `--start`, which `started` reads."""
    command.add_argument(
        "--start",
        type=start,
        metavar="A=1,B=2",
        help="in place of the scene's start: what differs from it, by names such as q0, qd.knee or knee, or all "
        "numbers of q and qd; without it, a scene that would only rest starts half a radian away",
    )


def start(text: str) -> library.Start:
    """`q0=0.3,qd.knee=1` as numbers by name, or `0.3,0,0,1` as all of them, for argparse."""
    return point(text) if "=" in text else [number(each) for each in text.split(",")]


def started(options: argparse.Namespace, *, free: bool = True) -> tuple[dyn.scenes.Scene, str]:
    """The scene that the arguments name, from the start that they name or one that shows something, and then why.

    free: whether nothing drives it, so that it may rest for ever.
    """
    scene = scene_of(options)
    if options.start is not None:
        return library.with_start(scene, options.start), ""
    moving = library.moving_start(scene) if free else scene
    if moving is scene:
        return scene, ""
    why = library.rest_text(scene, moving)
    say(f"{scene.name}: {why}; --start chooses another")
    return moving, why


def point_text(at: Mapping[str, float]) -> str:
    """`q.knee=0.1, qd.knee=2`, and of many inputs the first."""
    shown = [f"{name}={value:g}" for name, value in list(at.items())[:SHOWN]]
    rest = [f"and {len(at) - SHOWN} more"] if len(at) > SHOWN else []
    return ", ".join([*shown, *rest])


def _pairs(text: str) -> list[tuple[str, str]]:
    pairs: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not equals or not name.strip():
            raise argparse.ArgumentTypeError(f"expected NAME=VALUE, separated by commas, got {part!r}")
        name = name.strip()
        if name in pairs:
            raise argparse.ArgumentTypeError(f"{name} is given twice, as {pairs[name]} and as {value}")
        pairs[name] = value
    return list(pairs.items())


def _number(name: str, text: str) -> float:
    try:
        return number(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None
